"""Requests for simulations: closed-loop rollouts, segments and ensembles."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray
from selfmodel.errors import InputError, typed
from selfmodel.robot.anatomy import MAX_CONTROL_DELAY
from selfmodel.trials.signals import SIGNALS, Signal
from selfmodel.trials.trajectory import Trajectory

END = 1 / 3
"""Last part of a trial that shows the encoders of a failed joint: it may fail during the trial."""

LEAD = MAX_CONTROL_DELAY
"""Steps before a segment whose commands may take effect within it, by any control delay."""


WARM_UP = 0.48
"""Time after which the unknown state at the beginning of a chain has no effect, s. The base of a
quadruped and of a hexapod that began at rest, in place of 0.6 and 1.2 m/s, was off by 0.14 and 0.5
m/s after four segments of 0.12 s (0.10 and 0.14 in the middle of a trial), and the losses were
those of the middle."""

MAX_CHAIN = 12.0
"""Length of a chain, at most, if all segments of a trial are simulated, s."""


@typed
@dataclass(frozen=True)
class ClosedLoop:
    """A request for a rollout of the whole trial: its controller, from the initial pose.

    Attributes:
        record: The signals to record, ``(n, steps, width)`` each.
    """

    record: tuple[Signal, ...]


@typed
@dataclass(frozen=True, eq=False)
class Segments:
    """A request for short predictions, each from a logged state under the logged commands.

    Attributes:
        states: State at the beginning of each segment, ``(segments, width)`` for each signal of
            the joints' and the base's positions and velocities. NaN for the hinges whose state is
            unknown.
        commands: Logged commands of the whole trial, ``(steps, motors)``: control delays and the
            activation of motors depend on those before a segment. Those before the trial hold the
            robot in its initial pose.
        starts: Step of the trial at which each segment begins, ``(segments,)``.
        horizon: Control steps of a segment.
        record: The signals to record, ``(n, segments, horizon + 1, width)`` each; row 0 is the
            beginning. Any signal but ``commands``, which are inputs.
        chains: Number of chains of equal length, one after the other in ``starts``: without the
            whole state, a segment continues the one before in its chain.
        reads_encoders: Whether the logged readings of angles are those of the encoders, also of a
            detached limb, as in a recording of other software.
    """

    states: Mapping[Signal, FloatArray]
    commands: FloatArray
    starts: IndexArray
    horizon: int
    record: tuple[Signal, ...]
    chains: int = 1
    reads_encoders: bool = False

    def __post_init__(self) -> None:
        if self.chains < 1 or len(self.starts) % self.chains:
            parts = f"{len(self.starts)} segments, {self.chains} chains"
            raise InputError(f"expected chains of equal length: {parts}")

    @property
    def independent(self) -> bool:
        """Whether the state at the beginning of each segment is known completely.

        Otherwise, it continues the unknown part of the state of the segment before in its chain.
        """
        return "base_position" in self.states and not any(
            np.isnan(values).any() for values in self.states.values()
        )


@typed
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


def chained(count: int, most: int, length: float) -> tuple[IndexArray, BoolArray, int]:
    """Returns which of consecutive segments are simulated in chains, and which of these count.

    Of up to ``most`` segments, each ``length`` s long, all are; of more, parts of the trial as long
    as that: a segment that follows another one tells more than one after a gap, whose base begins
    in a state of another time. In chains that begin in mid-trial, the segments of the first
    ``WARM_UP`` s do not count. A part has at least twice as many; of a short trial, in which two
    parts would have more than ``most`` segments, there is one.

    Returns:
        Numbers of the segments, ``(chains * size,)``; a mask of those that count, likewise; and
        the number of chains.
    """
    warm_up = max(1, round(WARM_UP / length))
    if count <= most:
        longest = max(2 * warm_up, round(MAX_CHAIN / length))
        chains = max(1, math.ceil((count - warm_up) / (longest - warm_up)))
        size = math.ceil((count + (chains - 1) * warm_up) / chains)
    else:
        chains = 2 if most >= 4 * warm_up or count * length > MAX_CHAIN else 1
        size = min(max(most // chains, 2 * warm_up), count)
    # A single part is at the end: a fault may begin during the trial.
    first = np.floor(np.linspace(0 if chains > 1 else count - size, count - size, chains))
    rows = first.astype(np.intp)[:, np.newaxis] + np.arange(size)
    warm = rows[:, :1] + np.where(rows[:, :1] > 0, warm_up, 0)
    before = np.append(0, rows[:-1, -1] + 1)[:, np.newaxis]
    return rows.ravel(), (rows >= np.maximum(warm, before)).ravel(), chains


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
    *,
    chains: int = 1,
) -> Segments:
    """Returns segments of a trial, given the state at each of its steps, ``(steps, width)``."""
    at_starts = {signal: values[starts] for signal, values in states.items()}
    return Segments(at_starts, trajectory["commands"], starts, horizon, record, chains)
