"""What a comparator is: a distance between simulated behaviour and a logged trial."""

from typing import Protocol, runtime_checkable

from selfmodel.arrays import FloatArray
from selfmodel.simulation.requests import Request
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.trial import Trial


@runtime_checkable
class Comparator(Protocol):
    """Judges how far the behaviour that hypotheses predict is from what a trial showed.

    A plug-in is a plain object with these members. ``comparator_contract.check_comparator`` tests
    whether an object conforms.
    """

    @property
    def name(self) -> str:
        """What it is called on the command line and in results."""
        ...

    def request(self, trial: Trial) -> Request:
        """Returns what must be simulated to judge a trial.

        Raises:
            InputError: The trial lacks a signal that it needs; the sentence says which.
        """
        ...

    def distances(self, simulated: Behaviour, trial: Trial) -> FloatArray:
        """Returns how far each simulation is from the trial.

        It depends on its arguments alone and changes neither.

        Args:
            simulated: What was requested, with a leading axis of ``n`` hypotheses.
            trial: The logged trial, ``(steps, width)`` for each signal.

        Returns:
            ``(n,)`` finite numbers of at least 0, smaller is closer; exactly 0 for a simulation
            that did what the trial shows, as ``comparator_contract.shown`` does.
        """
        ...


@runtime_checkable
class Screened(Comparator, Protocol):
    """A comparator that knows a cheaper one, which tells what is far from what is near."""

    @property
    def screen(self) -> Comparator:
        """A comparator of the same kind that needs less to be simulated; piecewise as this is."""
        ...


@runtime_checkable
class Piecewise(Comparator, Protocol):
    """A comparator whose distance is the mean over pieces of the trial, such as windows of it.

    Only such a comparator can be asked whether one hypothesis is *significantly* closer than
    another: paired over the pieces.
    """

    def losses(self, simulated: Behaviour, trial: Trial) -> FloatArray:
        """Returns how badly each piece of the trial is predicted.

        Args:
            simulated: As for ``distances``.
            trial: As for ``distances``.

        Returns:
            ``(n, pieces)`` finite numbers of at least 0; ``distances`` is their mean over the
            pieces. The pieces are the same, in the same order, for every hypothesis.
        """
        ...
