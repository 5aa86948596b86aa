"""Requests for simulations: closed-loop rollouts, segments and ensembles."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.robot.anatomy import MAX_CONTROL_DELAY
from selfmodel.trials.signals import SIGNALS, Signal
from selfmodel.trials.trajectory import Trajectory

END = 1 / 3
"""Last part of a trial that shows the encoders of a failed joint: it may fail during the trial."""

LEAD = MAX_CONTROL_DELAY
"""Steps before a segment whose commands may take effect within it, by any control delay."""


@dataclass(frozen=True)
class ClosedLoop:
    """A request for a rollout of the whole trial: its controller, from the initial pose.

    Attributes:
        record: The signals to record, ``(n, steps, width)`` each.
    """

    record: tuple[Signal, ...]


@dataclass(frozen=True, eq=False)
class Segments:
    """A request for short predictions, each from a logged state under the logged commands.

    Attributes:
        states: State at the beginning of each segment, ``(segments, width)`` for each signal of
            the joints' and the base's positions and velocities. NaN for the hinges whose state is
            unknown.
        commands: Logged commands of the whole trial, ``(steps, motors)``: control delays and the
            activation of motors depend on those before a segment. Before the trial they are 0.
        starts: Step of the trial at which each segment begins, ``(segments,)``.
        horizon: Control steps of a segment.
        record: The signals to record, ``(n, segments, horizon + 1, width)`` each; row 0 is the
            beginning. Any signal but ``commands``, which are inputs.
    """

    states: Mapping[Signal, FloatArray]
    commands: FloatArray
    starts: IndexArray
    horizon: int
    record: tuple[Signal, ...]

    @property
    def independent(self) -> bool:
        """Whether the state at the beginning of each segment is known completely.

        Otherwise, a segment continues the unknown part of the state of the segment before.
        """
        return "base_position" in self.states and not any(
            np.isnan(values).any() for values in self.states.values()
        )


@dataclass(frozen=True)
class Ensemble:
    """A request for rollouts of the whole trial with several perturbed self-models.

    The members are the same for every hypothesis (common random numbers).

    Attributes:
        record: The signals to record, ``(n, members, steps, width)`` each.
        members: Simulations per hypothesis.
        level: Level of the reality gap from which the members are drawn.
    """

    record: tuple[Signal, ...]
    members: int
    level: float


Request = ClosedLoop | Segments | Ensemble
"""A simulation that a comparison with a trial requires."""


def recordable(request: Request) -> tuple[Signal, ...]:
    """Returns the signals that a request can record: those of a segment exclude its commands."""
    if isinstance(request, Segments):
        return tuple(signal for signal in SIGNALS if signal != "commands")
    return SIGNALS


def command_steps(starts: IndexArray, horizon: int) -> IndexArray:
    """Returns the steps whose commands may take effect in each segment; negative before the trial.

    The shape is ``(segments, LEAD + horizon)``.
    """
    return starts[:, np.newaxis] + np.arange(-LEAD, horizon)


def cut_segments(
    trajectory: Trajectory,
    states: Mapping[Signal, FloatArray],
    starts: IndexArray,
    horizon: int,
    record: tuple[Signal, ...],
) -> Segments:
    """Returns segments of a trial, given the state at each of its steps, ``(steps, width)``."""
    at_starts = {signal: values[starts] for signal, values in states.items()}
    return Segments(at_starts, trajectory["commands"], starts, horizon, record)
