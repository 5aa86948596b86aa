"""Comparator interface: distances between simulated behaviour and a logged trial."""

from collections.abc import Mapping
from typing import Protocol, runtime_checkable

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.errors import InputError
from selfmodel.simulation.requests import Request
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.trial import Trial


class TrialRefusedError(InputError):
    """A comparator cannot judge a trial, which lacks signals or steps.

    Attributes:
        reason: The trial, the requirement of the comparator and the content of the trial.

    Args:
        reason: As the attribute.
        remedy: Advice, after a colon in the message.
    """

    def __init__(self, reason: str, remedy: str = "") -> None:
        super().__init__(f"{reason}: {remedy}" if remedy else reason)
        self.reason = reason


@runtime_checkable
class PreparedTrial(Protocol):
    """A logged trial prepared for comparison, made by ``Comparator.prepare``.

    It contains everything that depends on the trial and not on a hypothesis, and is never changed
    after ``prepare``.
    """

    @property
    def request(self) -> Request:
        """The simulation that a comparison with the trial requires."""
        ...

    def distances(self, simulated: Behaviour) -> FloatArray:
        """Returns the distance of each simulation from the trial.

        The result depends on the prepared trial and the argument alone; neither is changed.

        Args:
            simulated: The requested signals, with a leading axis of ``n`` hypotheses.

        Returns:
            ``(n,)`` finite numbers of at least 0, smaller is closer; exactly 0 for a simulation
            that reproduces the trial, as ``selfmodel.testing.shown`` returns.
        """
        ...


@runtime_checkable
class PiecewiseTrial(PreparedTrial, Protocol):
    """A prepared trial whose distance is a mean of losses: of segments, windows or steps.

    The losses make a paired test possible: whether one hypothesis is *significantly* closer to
    the trial than another. With a single distance per trial there is no such test.
    """

    def losses(self, simulated: Behaviour) -> FloatArray:
        """Returns the loss of each segment, window or step of the trial.

        Args:
            simulated: As for ``distances``.

        Returns:
            ``(n, pieces)`` finite numbers of at least 0; ``distances`` is their mean over the
            pieces. The pieces and their order are the same for every hypothesis.
        """
        ...


@runtime_checkable
class TimedTrial(PiecewiseTrial, Protocol):
    """A prepared trial whose pieces have times, so that a change in time can be found."""

    @property
    def piece_steps(self) -> IndexArray:
        """First and last control step of each piece, ``(pieces, 2)``, in increasing order."""
        ...


@runtime_checkable
class LocatedTrial(PiecewiseTrial, Protocol):
    """A prepared trial whose losses are sums over signals."""

    def losses_by_signal(self, simulated: Behaviour) -> Mapping[str, FloatArray]:
        """Returns the part of each signal in the losses, ``(n, pieces)`` each.

        Args:
            simulated: As for ``distances``.
        """
        ...


@runtime_checkable
class HingewiseTrial(PiecewiseTrial, Protocol):
    """A prepared trial that predicts the motion of single hinges."""

    def losses_by_hinge(self, simulated: Behaviour) -> FloatArray:
        """Returns the loss of each hinge on its own, ``(n, pieces, hinges)``.

        These losses are used for faults of single joints, in addition to ``losses``. The hinges are
        in the order of the log's joint positions. A loss is NaN where the log contains no evidence
        on the hinge; all others are at least 0, and finite.

        Args:
            simulated: As for ``distances``.
        """
        ...


@runtime_checkable
class Comparator(Protocol):
    """A distance between simulated behaviour and a logged trial.

    A plug-in is an object with these members; no base class is required.
    ``selfmodel.testing.check_comparator`` tests conformance.
    """

    @property
    def name(self) -> str:
        """The name on the command line and in results."""
        ...

    def prepare(self, trial: Trial) -> PreparedTrial:
        """Returns the trial prepared for comparison: a ``PreparedTrial`` or ``PiecewiseTrial``.

        The result depends on the trial alone.

        Raises:
            TrialRefusedError: The trial lacks a required signal; the message names the signal. Any
                other ``InputError`` counts as this.
        """
        ...


@runtime_checkable
class ComparatorWithSurrogate(Comparator, Protocol):
    """A comparator with a surrogate: a cheaper comparator, used to pre-select hypotheses."""

    @property
    def surrogate(self) -> Comparator:
        """A comparator that requests less simulation and prepares trials of the same kind."""
        ...


def as_comparator(found: object, name: str) -> Comparator:
    """Returns an object as a comparator.

    Args:
        found: Any object.
        name: The name that the user gave, for the error.

    Raises:
        InputError: The object is no comparator, or is one of selfmodel 0.1.
    """
    if not isinstance(found, type):
        if isinstance(found, Comparator):
            return found
        if hasattr(found, "request") and hasattr(found, "distances"):
            raise InputError(
                f"{name!r} is a comparator of selfmodel 0.1: give it a method prepare(trial) that "
                f"returns an object with .request and .distances(simulated), both without the "
                f"argument trial, and .losses(simulated) if it had losses"
            )
    raise InputError(
        f"{name!r} is no comparator: expected an object, not a class, with the members of "
        f"selfmodel.diagnosis.comparator.Comparator, got {found!r}"
    )
