"""Simulation requests: rollouts, segments and ensembles that a comparator needs."""

from collections.abc import Mapping
from dataclasses import dataclass

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.trials.behaviour import SIGNALS, Signal


@dataclass(frozen=True)
class ClosedLoop:
    """A request to simulate the whole trial: its controller, from the start, for all its steps.

    Attributes:
        record: The signals that the comparator looks at, ``(n, steps, width)`` each.
    """

    record: tuple[Signal, ...]


@dataclass(frozen=True, eq=False)
class Past:
    """What was commanded before segments begin, for motors that remember it.

    Attributes:
        commands: Of the whole trial, ``(steps, motors)``; NaN where it is not known.
        starts: The step of the trial at which each segment begins, ``(segments,)``.
    """

    commands: FloatArray
    starts: IndexArray


@dataclass(frozen=True, eq=False)
class Segments:
    """A request to predict short stretches of the trial, each from a state that was logged.

    Attributes:
        states: The state at the beginning of each segment, ``(segments, width)`` for each signal
            of the joints' and the base's positions and velocities.
        commands: What was commanded then, ``(segments, lead + horizon, motors)``: the first
            ``lead`` rows were commanded before the segment begins, and matter to a model whose
            commands take effect late.
        lead: Rows of ``commands`` from before the segment: at least the robot's control delay,
            which is at most ``custom_numerics.MAX_CONTROL_DELAY``.
        record: The signals that the comparator looks at, ``(n, segments, horizon + 1, width)``
            each; row 0 is the beginning. Any but ``commands``, which are given.
        past: What motors remember that have a state of their own, such as a filter; None: only
            what stands in ``commands``.
    """

    states: Mapping[Signal, FloatArray]
    commands: FloatArray
    lead: int
    record: tuple[Signal, ...]
    past: Past | None = None

    @property
    def horizon(self) -> int:
        """Control steps that a segment lasts."""
        return int(self.commands.shape[1]) - self.lead


@dataclass(frozen=True)
class Ensemble:
    """A request to simulate the whole trial many times, each with a self-model a little different.

    The members are the same for every hypothesis (common random numbers).

    Attributes:
        record: The signals that the comparator looks at, ``(n, members, steps, width)`` each.
        members: Simulations of each hypothesis.
        level: The level of the reality gap that the members are drawn from.
    """

    record: tuple[Signal, ...]
    members: int
    level: float


Request = ClosedLoop | Segments | Ensemble
"""What may be simulated to judge a trial."""


def recordable(request: Request) -> tuple[Signal, ...]:
    """Returns the signals that what was requested can record.

    A segment is given its commands, so there is nothing to record of them.
    """
    if isinstance(request, Segments):
        return tuple(signal for signal in SIGNALS if signal != "commands")
    return SIGNALS
