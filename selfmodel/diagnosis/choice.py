"""Preparation of trials for a comparator, and the choice of one that accepts all trials."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from selfmodel.controllers.playback import Playback
from selfmodel.diagnosis.comparator import (
    Comparator,
    PiecewiseTrial,
    PreparedTrial,
    TrialRefusedError,
)
from selfmodel.errors import InputError
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import BASE_SIGNALS, completed_trial
from selfmodel.simulation.requests import Segments, recordable
from selfmodel.trials.trial import Trial, check_magnitudes


def contract_error(comparator: Comparator, problem: str) -> InputError:
    """Returns the error for a comparator that breaks its contract."""
    return InputError(
        f"the comparator {comparator.name!r} {problem}: run selfmodel.check_comparator on it"
    )


def prepared_trial(
    comparator: Comparator, robot: Robot, trial: Trial
) -> PreparedTrial | PiecewiseTrial:
    """Returns a trial of a robot prepared for comparison, checked.

    Raises:
        TrialRefusedError: The comparator does not accept the trial.
        InputError: The comparator breaks its contract, or a compared number is absurdly large.
    """
    # Numbers that are too large for arithmetic are refused by name, after the preparation.
    with np.errstate(over="ignore", invalid="ignore"):
        complete = completed_trial(robot, trial)
        try:
            prepared: object = comparator.prepare(complete)
        except TrialRefusedError:
            raise
        except InputError as error:  # of a third-party comparator
            raise TrialRefusedError(str(error)) from error
    if not isinstance(prepared, PreparedTrial | PiecewiseTrial):
        raise contract_error(
            comparator, f"prepared {prepared!r}, which has no request with losses or distances"
        )
    request, possible = prepared.request, recordable(prepared.request)
    if not request.record or not set(request.record) <= set(possible):
        raise contract_error(
            comparator, f"requested the signals {request.record!r}, of {', '.join(possible)}"
        )
    if robot.has_fixed_base and set(request.record) <= set(BASE_SIGNALS):
        raise TrialRefusedError(
            f"{comparator.name} compares the motion of the base, and the base of {robot.name} is "
            f"fixed",
            "give the comparator segment-prediction",
        )
    driver = trial.plan.controller
    if isinstance(driver, Playback) and driver.function and not isinstance(request, Segments):
        raise TrialRefusedError(
            f"{trial.path}: {comparator.name} simulates whole trials, and the log has only the "
            f"commands of the function {driver.function}, which do not react to a fault",
            "give the comparator segment-prediction",
        )
    states = (*request.states, "commands") if isinstance(request, Segments) else ()
    check_magnitudes(trial, tuple(dict.fromkeys((*states, *request.record))))
    return prepared


@dataclass(frozen=True)
class ChosenComparator:
    """A comparator that accepts all trials, and the reason for the choice, a clause."""

    comparator: Comparator
    reason: str

    def __str__(self) -> str:
        return f"comparator {self.comparator.name}: {self.reason}"


ComparatorChoice = Callable[[Robot, Sequence[Trial]], ChosenComparator]
"""Returns a comparator that accepts all trials of a robot, or raises ``InputError``."""


def chosen_comparator(
    preference: Sequence[Comparator],
    robot: Robot,
    trials: Sequence[Trial],
    *,
    given: Comparator | None = None,
) -> ChosenComparator:
    """Returns the given comparator, or the first of the preference that accepts all trials.

    Args:
        preference: At least one comparator, best first; the last needs the fewest signals.
        robot: The self-model.
        trials: Logged trials of the robot.
        given: The choice of the caller.

    Raises:
        InputError: The comparator does not accept all trials; the message has the reason for each
            trial, and the first comparator of the preference that accepts all of them. Or a
            comparator breaks its contract, or a compared number is absurdly large.
    """
    reasons: list[str] = []
    for comparator in preference if given is None else (given,):
        refused = _refusals(comparator, robot, trials)
        if not refused:
            reason = "; ".join(reasons) or "the logs have all signals"
            return ChosenComparator(comparator, reason if given is None else "given")
        reasons += refused
    problems = "; ".join(dict.fromkeys(refused))
    if given is None:
        raise InputError(
            f"no comparator of selfmodel can judge these trials: {problems}: leave these trials out"
        )
    able = [other for other in preference if not _refusals(other, robot, trials)]
    remedy = f"give the comparator {able[0].name}, which can judge all trials, or " if able else ""
    raise InputError(f"{problems}: {remedy}leave these trials out")


def _refusals(comparator: Comparator, robot: Robot, trials: Sequence[Trial]) -> list[str]:
    reasons = []
    for trial in trials:
        try:
            prepared_trial(comparator, robot, trial)
        except TrialRefusedError as error:
            reasons.append(error.reason)
    return reasons
