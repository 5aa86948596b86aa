"""The subject of a report in the folder of a run: logs, diagnoses and result of a recovery."""

from collections.abc import Sequence
from pathlib import Path

from selfmodel import arguments
from selfmodel.api import by_stage
from selfmodel.arguments import AUTO, comparator_choice, fitted
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.errors import InputError
from selfmodel.faults.kind import FaultKind
from selfmodel.logs.journal import (
    DIAGNOSES,
    TRIALS,
    is_calibrated,
    read_diagnoses,
    trial_order,
)
from selfmodel.report.progress import read_searches
from selfmodel.report.recorded.calibration import recorded_calibration
from selfmodel.report.recorded.plug_ins import comparator_name, recorded_space
from selfmodel.report.run_result import RESULT, RunResult, parsed, read_run_result
from selfmodel.report.subject import Subject
from selfmodel.robot.robot import Robot
from selfmodel.simulation.calibration import Calibration
from selfmodel.trials.trial import Trial

REPORT = "report.html"
"""File of the report in the folder of a run or of a campaign."""


def is_run(folder: Path) -> bool:
    """Returns whether a folder is that of a run with at least one diagnosis."""
    return (folder / TRIALS).is_dir() and (folder / DIAGNOSES).is_file()


def subject_of_run(
    folder: Path,
    threads: int = 0,
    comparator: str = AUTO,
    kinds: Sequence[FaultKind] = (),
) -> Subject:
    """Returns the subject of a report on a run.

    Without a ``result.json``, as of a run that goes on or was interrupted, the comparator is the
    best one for the trials, and the self-model is fitted to the healthy trials, unless the run
    was begun without calibration.

    Args:
        folder: Folder of the run.
        threads: Threads of the physics; 0 for all processors.
        comparator: Name of the comparator of the run, which may be ``package.module:object``;
            ``auto`` for that of its result.
        kinds: Fault kinds of the run that are no entry points.

    Raises:
        InputError: The folder has no logs or diagnoses, or a file of it is damaged.
    """
    paths = sorted((folder / TRIALS).glob("*.mcap"), key=trial_order)
    if not paths:
        raise InputError(f"{folder}: expected the folder of a run with logs in {TRIALS}, got none")
    logs = arguments.read_logs(paths)
    robot = arguments.robot_of_logs(logs, None)
    result = read_run_result(folder)
    space = recorded_space(folder / RESULT, robot, result.kinds if result else (), kinds)
    diagnoses = read_diagnoses(folder, space)
    damaged, healthy = by_stage([log.trial for log in logs])
    if not diagnoses or not damaged:
        raise InputError(
            f"{folder}: expected a run with a diagnosis, got none yet: wait for its first "
            f"diagnosis, or give its logs"
        )
    _check_counts(folder / DIAGNOSES, diagnoses, len(damaged))
    explained = damaged[: diagnoses[-1].trials]
    if result is not None:
        comparator = comparator_name(folder / RESULT, result.comparator, comparator)
    return Subject(
        title=folder.resolve().name,
        robot=robot,
        healthy=tuple(healthy),
        damaged=tuple(explained),
        diagnoses=diagnoses,
        comparator=comparator_choice(comparator)(robot, [*healthy, *explained]).comparator,
        calibration=_calibration(folder, robot, healthy, result, threads),
        result=result,
        searches=read_searches(folder),
        made_with=logs[0].software,
        threads=threads,
    )


def _check_counts(path: Path, diagnoses: Sequence[Diagnosis], trials: int) -> None:
    """Checks that each diagnosis is of logs that are there: a damaged run may lack some.

    Raises:
        InputError: A diagnosis is of no or of more trials, or has a change in none of its trials.
    """
    for diagnosis in diagnoses:
        change = diagnosis.change
        if not 1 <= diagnosis.trials <= trials or (
            change is not None and not 0 <= change.index < diagnosis.trials
        ):
            place = "" if change is None else f", with a change in trial {change.index}"
            raise InputError(
                f"{path}: expected diagnoses of 1 to {trials} trials, as many as the folder "
                f"{TRIALS} has after the failure, got one of {diagnosis.trials}{place}: put back "
                f"the logs that were moved away, or give the logs instead of the folder"
            )


def _calibration(
    folder: Path, robot: Robot, healthy: list[Trial], result: RunResult | None, threads: int
) -> Calibration | None:
    """Returns the calibration of a run: that of its result, or a new one if it has one."""
    if result is None:
        return fitted(robot, healthy, threads) if healthy and is_calibrated(folder) else None
    values = result.calibration
    return parsed(folder / RESULT, lambda: recorded_calibration(robot, healthy, values, threads))
