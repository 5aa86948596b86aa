"""What a comparator is: a distance between simulated behaviour and a logged trial."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from selfmodel.arrays import FloatArray
from selfmodel.behaviour import Behaviour, Signal
from selfmodel.trial import Trial


@dataclass(frozen=True)
class ClosedLoop:
    """A request to simulate the whole trial: its controller, from the start, for all its steps.

    Attributes:
        record: The signals that the comparator looks at.
    """

    record: tuple[Signal, ...]


@runtime_checkable
class Comparator(Protocol):
    """Judges how far the behaviour that hypotheses predict is from what a trial showed.

    A plug-in is a plain object with these members; ``selfmodel.contract.check_comparator`` tests
    whether it keeps to what is said here.
    """

    @property
    def name(self) -> str:
        """What it is called on the command line and in results."""
        ...

    def request(self, trial: Trial) -> ClosedLoop:
        """Returns what must be simulated to judge a trial.

        Raises:
            InputError: The trial lacks a signal that it needs; the sentence says which.
        """
        ...

    def distances(self, simulated: Behaviour, trial: Trial) -> FloatArray:
        """Returns how far each simulation is from the trial.

        It depends on its arguments alone and changes neither.

        Args:
            simulated: What was requested, ``(n, steps, width)`` for each signal.
            trial: The logged trial, ``(steps, width)`` for each signal.

        Returns:
            ``(n,)`` finite numbers of at least 0, smaller is closer; 0 for a simulation that did
            what the trial shows.
        """
        ...
