"""Comparator interface: losses of simulated trajectories against a logged trial."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray
from selfmodel.errors import InputError
from selfmodel.simulation.requests import Request
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import Trial, TrialPart


@runtime_checkable
class Comparator(Protocol):
    """A distance between simulated trajectories and a logged trial.

    A plug-in is an object with these members; no base class is required.
    ``selfmodel.check_comparator`` tests conformance. An attribute ``surrogate`` is optional: a
    comparator that requests less simulation, to pre-select hypotheses.
    """

    @property
    def name(self) -> str:
        """The name on the command line and in results."""
        ...

    def prepare(self, trial: Trial) -> "PreparedTrial | PiecewiseTrial":
        """Returns the trial prepared for comparison; the result depends on the trial alone.

        Raises:
            TrialRefusedError: The trial lacks a required signal; the message names the signal. Any
                other ``InputError`` counts as this.
        """
        ...


@runtime_checkable
class PreparedTrial(Protocol):
    """A logged trial prepared for comparison, with one distance per hypothesis.

    It contains everything that depends on the trial and not on a hypothesis, and is never changed
    after ``Comparator.prepare``.
    """

    @property
    def request(self) -> Request:
        """The simulation that a comparison with the trial requires."""
        ...

    def distances(self, simulated: Trajectory, /) -> FloatArray:
        """Returns the distance of each simulation from the trial.

        The result depends on the prepared trial and the argument alone; neither is changed. The
        argument has the requested signals, with a leading axis of ``n`` hypotheses, and the hinges
        that each hypothesis fixes; see ``Trajectory``.

        Returns:
            ``(n,)`` finite numbers of at least 0, smaller is closer; exactly 0 for a simulation
            that reproduces the trial, as ``selfmodel.testing.shown`` returns.
        """
        ...


@runtime_checkable
class PiecewiseTrial(Protocol):
    """A prepared trial with losses of segments, windows or steps, whose mean is the distance.

    The losses make a paired test possible: whether one hypothesis is *significantly* closer to
    the trial than another. An attribute ``piece_steps`` is optional: the first and the last
    control step of each piece, ``(pieces, 2)``, in increasing order. With it, a change in time can
    be found. ``sections`` is optional too: prepared trials of parts of a long trial, which together
    have these pieces in this order; of a part of the trial, only its sections are simulated.
    """

    @property
    def request(self) -> Request:
        """The simulation that a comparison with the trial requires."""
        ...

    def losses(self, simulated: Trajectory, /) -> "FloatArray | Losses":
        """Returns the loss of each segment, window or step; see ``PreparedTrial.distances``.

        Returns:
            ``(n, pieces)`` finite numbers of at least 0, and 0 for a simulation that reproduces the
            trial. The pieces and their order are the same for every hypothesis.
        """
        ...


@dataclass(frozen=True, eq=False)
class Losses:
    """Losses of simulations of a trial, with their parts.

    Attributes:
        total: Loss of each segment, window or step, ``(n, pieces)``.
        by_signal: Part of each signal in the total, ``(n, pieces)`` each; empty if the losses are
            no sums over signals.
        by_hinge: Loss of each hinge on its own, ``(n, pieces, hinges)``, in the order of the log's
            joint positions; no part of the total. It decides on faults of single joints. NaN
            without evidence on the hinge. None if no single hinges are predicted.
    """

    total: FloatArray
    by_signal: Mapping[str, FloatArray] = field(default_factory=dict)
    by_hinge: FloatArray | None = None

    def __getitem__(self, row: int) -> "Losses":
        """Returns the losses of one simulation, without the leading axis."""
        by_hinge = None if self.by_hinge is None else self.by_hinge[row]
        by_signal = {signal: losses[row] for signal, losses in self.by_signal.items()}
        return Losses(self.total[row], by_signal, by_hinge)


@dataclass(frozen=True, eq=False)
class Prepared:
    """A ``PiecewiseTrial`` of a request and a function that returns the losses."""

    request: Request
    losses: Callable[[Trajectory], FloatArray | Losses]
    piece_steps: IndexArray | None = None
    sections: Sequence["Prepared"] = ()


PreparedPart = PreparedTrial | PiecewiseTrial
"""A prepared trial, or a section of one."""


def piece_steps_of(prepared: PreparedPart) -> IndexArray | None:
    """Returns the first and the last step of each piece, ``(pieces, 2)``; None without any."""
    steps: IndexArray | None = getattr(prepared, "piece_steps", None)
    return steps


def pieces_within(part: TrialPart, prepared: PreparedPart) -> BoolArray | slice:
    """Returns which pieces lie within a part of a trial."""
    steps = piece_steps_of(prepared)
    if part.is_whole or steps is None:
        return slice(None)
    times = part.trial.trajectory.time[steps]
    return np.asarray((times[:, 0] >= part.begin) & (times[:, 1] <= part.end))


class TrialRefusedError(InputError):
    """A trial lacks signals or steps that a comparator needs.

    The reason names the trial, the requirement of the comparator and the content of the trial; the
    remedy is advice, after a colon in the message.
    """

    def __init__(self, reason: str, remedy: str = "") -> None:
        super().__init__(f"{reason}: {remedy}" if remedy else reason)
        self.reason = reason


def as_comparator(value: Any, name: str = "") -> Comparator:  # noqa: ANN401  # of a plug-in
    """Returns an object as a comparator, or raises an ``InputError`` with the name given to it."""
    if isinstance(value, Comparator) and not isinstance(value, type):
        return value
    called = name or getattr(value, "__name__", type(value).__name__)
    lacks = " and ".join(one for one in ("name", "prepare") if not hasattr(value, one))
    wrong = "a class" if isinstance(value, type) else f"one without {lacks}"
    raise InputError(
        f"{called!r} is no comparator: expected an object, not a class, with name and prepare, as "
        f"help(selfmodel.Comparator) says, got {wrong}: {value!r}"
    )
