"""Simulation requests: closed-loop rollouts, segments and ensembles."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.robot.control_delay import MAX_CONTROL_DELAY
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.signals import SIGNALS, Signal

END = 1 / 3
"""Last part of a trial that shows the encoders of a failed joint: it may fail during the trial."""

LEAD = MAX_CONTROL_DELAY
"""Commands before a segment that ``cut_segments`` includes: enough for every control delay."""


@dataclass(frozen=True)
class ClosedLoop:
    """A request for a rollout of the whole trial: its controller, from the initial pose.

    Attributes:
        record: The signals to record, ``(n, steps, width)`` each.
    """

    record: tuple[Signal, ...]


@dataclass(frozen=True, eq=False)
class Past:
    """Commands before segments, for motors with activation dynamics.

    Attributes:
        commands: Commands of the whole trial, ``(steps, motors)``; NaN where unknown.
        starts: Step of the trial at which each segment begins, ``(segments,)``.
    """

    commands: FloatArray
    starts: IndexArray


@dataclass(frozen=True, eq=False)
class Segments:
    """A request for short predictions, each from a logged state under logged commands.

    Attributes:
        states: State at the beginning of each segment, ``(segments, width)`` for each signal of
            the joints' and the base's positions and velocities. NaN for the hinges whose state is
            unknown.
        commands: Logged commands, ``(segments, lead + horizon, motors)``: the first ``lead`` rows
            precede the segment, for models with a control delay.
        lead: Rows of ``commands`` before the segment: at least the robot's control delay, which is
            at most ``control_delay.MAX_CONTROL_DELAY``.
        record: The signals to record, ``(n, segments, horizon + 1, width)`` each; row 0 is the
            beginning. Any signal but ``commands``, which are inputs.
        past: Commands since the beginning of the trial, for motors with a state of their own, such
            as a filter; None if only ``commands`` are known.
    """

    states: Mapping[Signal, FloatArray]
    commands: FloatArray
    lead: int
    record: tuple[Signal, ...]
    past: Past | None = None

    @property
    def horizon(self) -> int:
        """Control steps of a segment."""
        return int(self.commands.shape[1]) - self.lead

    @property
    def resting_angles(self) -> FloatArray | None:
        """Angle at which the hinges of detached limbs are predicted: the median at the end.

        The last third of the segments counts, because a limb may be lost during a trial. The shape
        is ``(hinges,)``, rad, with NaN for a hinge without a known angle; None for segments without
        joint positions.
        """
        angles = self.states.get("joint_positions")
        if angles is None:
            return None
        last = angles[round((1 - END) * len(angles)) :]
        known = (column[~np.isnan(column)] for column in last.T)
        return np.array([np.median(own) if len(own) else np.nan for own in known])

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
    """Returns the signals that a request can record.

    The commands of a segment are inputs, so they cannot be recorded.
    """
    if isinstance(request, Segments):
        return tuple(signal for signal in SIGNALS if signal != "commands")
    return SIGNALS


def command_steps(starts: IndexArray, horizon: int) -> IndexArray:
    """Returns the steps whose commands a segment includes.

    Args:
        starts: Step at which each segment begins, ``(segments,)``.
        horizon: Control steps of a segment.

    Returns:
        ``(segments, LEAD + horizon)``; negative for steps before the trial.
    """
    return starts[:, np.newaxis] + np.arange(-LEAD, horizon)


def cut_segments(
    behaviour: Behaviour,
    states: Mapping[Signal, FloatArray],
    starts: IndexArray,
    horizon: int,
    record: tuple[Signal, ...],
) -> Segments:
    """Returns segments of a trial, with ``LEAD`` commands before each.

    Args:
        behaviour: The logged behaviour of the trial.
        states: State at each step, ``(steps, width)`` for each signal.
        starts: Step at which each segment begins, ``(segments,)``.
        horizon: Control steps of a segment.
        record: The signals to record.
    """
    commands, steps = behaviour["commands"], command_steps(starts, horizon)
    return Segments(
        states={signal: values[starts] for signal, values in states.items()},
        # Before the trial the motors hold 0.
        commands=np.where(steps[..., np.newaxis] < 0, 0.0, commands[np.maximum(steps, 0)]),
        lead=LEAD,
        record=record,
        past=Past(commands, starts),
    )
