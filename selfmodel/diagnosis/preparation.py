"""Preparation of a trial for a comparator, with checks of both."""

from collections.abc import Sequence

import numpy as np

from selfmodel.diagnosis.comparator import Comparator, PreparedTrial, TrialRefusedError
from selfmodel.errors import InputError
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import BASE_SIGNALS, completed_trial
from selfmodel.simulation.requests import Request, Segments, recordable
from selfmodel.trials.signals import Signal
from selfmodel.trials.trial import Trial, check_magnitudes


def prepared_trial(comparator: Comparator, robot: Robot, trial: Trial) -> PreparedTrial:
    """Returns a trial prepared for comparison, checked.

    Args:
        comparator: The comparator.
        robot: The self-model.
        trial: A logged trial of the robot.

    Raises:
        TrialRefusedError: The comparator cannot judge the trial.
        InputError: The comparator breaks its contract, or a compared number is absurdly large.
    """
    # Numbers that are too large for arithmetic are refused by name, after the preparation.
    with np.errstate(over="ignore", invalid="ignore"):
        known = completed_trial(robot, trial)
        try:
            prepared = comparator.prepare(known)
        except TrialRefusedError:
            raise
        except InputError as error:  # of a third-party comparator
            raise TrialRefusedError(str(error)) from error
    _check_prepared(comparator, robot, prepared)
    check_magnitudes(trial, _compared_signals(prepared.request))
    return prepared


def refusals(
    comparator: Comparator, robot: Robot, trials: Sequence[Trial]
) -> list[TrialRefusedError]:
    """Returns the reasons for which a comparator cannot judge trials; none if it can judge all.

    Args:
        comparator: The comparator.
        robot: The self-model.
        trials: Logged trials of the robot.

    Raises:
        InputError: The comparator breaks its contract, or a compared number is absurdly large.
    """
    found = []
    for trial in trials:
        try:
            prepared_trial(comparator, robot, trial)
        except TrialRefusedError as error:
            found.append(error)
    return found


def contract_error(comparator: Comparator, problem: str) -> InputError:
    """Returns the error for a comparator that breaks its contract."""
    return InputError(
        f"the comparator {comparator.name!r} {problem}: run "
        f"selfmodel.testing.check_comparator on it"
    )


def _check_prepared(comparator: Comparator, robot: Robot, prepared: object) -> None:
    if not isinstance(prepared, PreparedTrial):
        raise contract_error(comparator, f"prepared {prepared!r}, which is no PreparedTrial")
    possible, record = recordable(prepared.request), prepared.request.record
    if not record or not set(record) <= set(possible):
        raise contract_error(
            comparator, f"requested the signals {record!r}, of {', '.join(possible)}"
        )
    if robot.has_fixed_base and set(record) <= set(BASE_SIGNALS):
        raise TrialRefusedError(
            f"{comparator.name} compares the motion of the base, and the base of {robot.name} is "
            f"fixed",
            "give the comparator segment-prediction",
        )


def _compared_signals(request: Request) -> tuple[Signal, ...]:
    """Returns the signals of a trial that a comparison depends on, each once."""
    states = (*request.states, "commands") if isinstance(request, Segments) else ()
    return tuple(dict.fromkeys((*states, *request.record)))
