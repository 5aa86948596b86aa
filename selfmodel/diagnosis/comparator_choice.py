"""Choice of a comparator that can judge all trials, before anything is simulated."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from selfmodel.diagnosis.comparator import Comparator
from selfmodel.diagnosis.preparation import refusals
from selfmodel.errors import InputError
from selfmodel.robot.robot import Robot
from selfmodel.trials.trial import Trial


@dataclass(frozen=True)
class ChosenComparator:
    """A comparator that can judge all trials.

    Attributes:
        comparator: The comparator.
        reason: The reason for the choice, a clause.
    """

    comparator: Comparator
    reason: str


ComparatorChoice = Callable[[Robot, Sequence[Trial]], ChosenComparator]
"""Returns a comparator that can judge all trials of a robot, or raises ``InputError``."""


def best_comparator(
    preference: Sequence[Comparator], robot: Robot, trials: Sequence[Trial]
) -> ChosenComparator:
    """Returns the first comparator that can judge all trials.

    Args:
        preference: At least one comparator, best first; the last needs the fewest signals.
        robot: The self-model.
        trials: Logged trials of the robot.

    Raises:
        InputError: No comparator can judge all trials; the message has the reasons of the last one
            for each trial. Or a compared number is absurdly large.
    """
    reasons: list[str] = []
    for comparator in preference:
        refused = refusals(comparator, robot, trials)
        if not refused:
            return ChosenComparator(comparator, "; ".join(reasons) or "the logs have all signals")
        reasons += [error.reason for error in refused]
    raise InputError(
        f"no comparator of selfmodel can judge these trials: "
        f"{'; '.join(error.reason for error in refused)}: leave these trials out"
    )


def given_comparator(
    comparator: Comparator,
    preference: Sequence[Comparator],
    robot: Robot,
    trials: Sequence[Trial],
) -> ChosenComparator:
    """Returns a comparator that the caller gave, if it can judge all trials.

    Args:
        comparator: The comparator.
        preference: Comparators to name in the error, best first.
        robot: The self-model.
        trials: Logged trials of the robot.

    Raises:
        InputError: The comparator cannot judge all trials; the message has the reason for each
            trial, and the first comparator of the preference that can judge all of them. Or the
            comparator breaks its contract, or a compared number is absurdly large.
    """
    refused = refusals(comparator, robot, trials)
    if not refused:
        return ChosenComparator(comparator, "given")
    able = [other for other in preference if not refusals(other, robot, trials)]
    remedy = (
        f"give the comparator {able[0].name}, which can judge all trials, or leave these trials out"
        if able
        else "leave these trials out"
    )
    raise InputError(f"{'; '.join(error.reason for error in refused)}: {remedy}")
