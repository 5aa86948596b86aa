"""What a report is about: trials of one robot, their diagnoses, and the self-model behind them.

A subject is read from the folder of a run, or from logs and the file of their diagnosis. No name in
a file is imported: plug-ins that are no entry points have to be given.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from selfmodel import arguments
from selfmodel.api import by_stage
from selfmodel.arguments import AUTO, comparator_choice, fitted
from selfmodel.diagnosis.comparator import Comparator
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.diagnosis.losses import LossTable
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.kind import FaultKind
from selfmodel.files import encodable
from selfmodel.logs.journal import (
    DIAGNOSES,
    TRIALS,
    is_calibrated,
    read_diagnoses,
    trial_order,
)
from selfmodel.logs.results import (
    RESULT,
    RecoveryResult,
    Search,
    read_as,
    read_searches,
)
from selfmodel.report.recorded import (
    DiagnosisFile,
    comparator_name,
    recorded_calibration,
    recorded_space,
)
from selfmodel.robot.robot import Robot
from selfmodel.simulation.calibration import Calibration
from selfmodel.simulation.simulator import Simulator, thread_count
from selfmodel.trials.trial import Trial, trial_names

WHAT, REMEDY = (
    "the result of a recovery",
    "move it away, and the report is made of the logs and diagnoses",
)
"""What a result.json is, and the remedy for one that is damaged, for errors."""


@dataclass(frozen=True, eq=False)
class Subject:
    """Trials of one robot, and what is known about them.

    Attributes:
        name: Name of the run or of the logs.
        robot: The nominal robot.
        healthy: Trials of the healthy robot.
        damaged: Trials to explain, in order.
        diagnoses: Diagnoses, at least one; the last is of all trials to explain.
        comparator: Comparator of the diagnoses.
        calibration: Fit of the self-model to the healthy trials; None without one.
        result: Result of a run; None for logs, and for a run that is not finished.
        searches: Progress of the searches; empty if it was not recorded.
        made_with: Versions by the name of the software.
        threads: Threads of the physics.
    """

    name: str
    robot: Robot
    healthy: tuple[Trial, ...]
    damaged: tuple[Trial, ...]
    diagnoses: tuple[Diagnosis, ...]
    comparator: Comparator
    calibration: Calibration | None
    result: RecoveryResult | None = None
    searches: tuple[Search, ...] = ()
    made_with: Mapping[str, str] = field(default_factory=dict)
    threads: int = 0

    @property
    def title(self) -> str:
        """Title of the report."""
        return title_of(self.robot, self.name)

    @property
    def diagnosis(self) -> Diagnosis:
        """The last diagnosis."""
        return self.diagnoses[-1]

    @property
    def trials(self) -> tuple[Trial, ...]:
        """All trials, those of the healthy robot first."""
        return (*self.healthy, *self.damaged)

    @cached_property
    def names(self) -> Mapping[str, str]:
        """Name of each trial, by its path."""
        return {path: encodable(name) for path, name in trial_names(self.trials).items()}

    @cached_property
    def simulator(self) -> Simulator:
        """Simulator of the self-model."""
        model = self.robot if self.calibration is None else self.calibration.robot
        return Simulator(model, self.threads)

    @cached_property
    def losses(self) -> LossTable:
        """Losses of hypotheses on the trials."""
        return LossTable(self.simulator, self.comparator)

    @property
    def runner_up(self) -> Hypothesis | None:
        """The hypothesis to compare with the best: an indistinguishable one, or the next."""
        others = [*self.diagnosis.indistinguishable]
        others += [candidate.hypothesis for candidate in self.diagnosis.ranked]
        return next((one for one in others if one != self.diagnosis.best), None)

    @property
    def shown_hypotheses(self) -> tuple[tuple[str, Hypothesis], ...]:
        """The hypotheses of charts over time: best, runner-up and the healthy robot."""
        named = [("best", self.diagnosis.best)]
        named += [("runner-up", self.runner_up)] if self.runner_up is not None else []
        if all(one != INTACT for _, one in named):
            named.append(("healthy", INTACT))
        return tuple((f"{name}: {one}", one) for name, one in named)

    def change_of(self, trial: Trial) -> tuple[float, float, float] | None:
        """Returns time, lower and upper bound of a change of the robot in a trial, s."""
        change = self.diagnosis.change
        if change is None or self.damaged[change.index].path != trial.path:
            return None
        return change.time, change.earliest, change.latest


def title_of(robot: Robot, name: str) -> str:
    """Returns the title of the report of a run or of logs."""
    return f"{robot.name}: {encodable(name)}"


def is_run(folder: Path) -> bool:
    """Returns whether a folder is that of a run with at least one diagnosis."""
    return (folder / TRIALS).is_dir() and (folder / DIAGNOSES).is_file()


def subject_of_run(
    folder: Path, threads: int = 0, comparator: str = AUTO, kinds: Sequence[FaultKind] = ()
) -> Subject:
    """Returns the subject of a report on a run.

    Without a ``result.json``, as of a run that is not finished or was interrupted, the comparator
    is the best one for the trials, and the self-model is fitted to the healthy trials, unless the
    run was begun without calibration.

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
    damaged, healthy = by_stage([log.trial for log in logs])
    path, result, count = folder / RESULT, None, thread_count(threads)
    if path.exists():
        result = read_as(path, RecoveryResult, WHAT, REMEDY)
        comparator = comparator_name(path, result.comparator, comparator)
    diagnoses = read_diagnoses(
        folder, recorded_space(path, robot, result.kinds if result else (), kinds)
    )
    if not diagnoses or not damaged:
        raise InputError(
            f"{folder}: expected a run with a diagnosis, got none yet: wait for its first "
            f"diagnosis, or give its logs"
        )
    _check_counts(folder / DIAGNOSES, diagnoses, len(damaged))
    explained = damaged[: diagnoses[-1].trials]
    if result is None:
        fits = bool(healthy) and is_calibrated(folder)
        calibration = fitted(robot, healthy, count) if fits else None
    else:
        calibration = recorded_calibration(
            path, result, robot, healthy, threads=count, words=(WHAT, REMEDY)
        )
    return Subject(
        name=folder.resolve().name,
        robot=robot,
        healthy=tuple(healthy),
        damaged=tuple(explained),
        diagnoses=diagnoses,
        comparator=comparator_choice(comparator)(robot, [*healthy, *explained]).comparator,
        calibration=calibration,
        result=result,
        searches=read_searches(folder),
        made_with=logs[0].software,
        threads=count,
    )


def subject_of_logs(
    paths: Sequence[Path],
    diagnosis: Path,
    *,
    robot: str | None = None,
    threads: int = 0,
    comparator: str = AUTO,
    kinds: Sequence[FaultKind] = (),
) -> Subject:
    """Returns the subject of a report on logs that were diagnosed before.

    Args:
        paths: The logs of the diagnosis, in any order.
        diagnosis: Output of ``selfmodel diagnose --json``, or the ``result.json`` of a recovery.
        robot: Self-model instead of that in the logs, as in ``--robot`` of the diagnosis.
        threads: Threads of the physics; 0 for all processors.
        comparator: ``auto`` for the comparator that the file names; its name, such as
            ``package.module:object``, if it is no entry point.
        kinds: Fault kinds of the diagnosis that are no entry points.

    Raises:
        InputError: The diagnosis is of other logs, of another self-model or with another
            comparator, or a file is damaged.
    """
    file = DiagnosisFile(diagnosis)
    explained, intact = file.matched(paths)
    logs = arguments.read_logs([*explained, *intact])
    model = arguments.robot_of_logs(logs, robot)
    file.check_self_model(model)
    found = file.diagnosis(recorded_space(diagnosis, model, file.result.kinds, kinds))
    trials = [log.trial for log in logs]
    damaged, healthy = tuple(trials[: len(explained)]), tuple(trials[len(explained) :])
    name = comparator_name(diagnosis, file.result.comparator, comparator)
    count = thread_count(threads)
    return Subject(
        name=", ".join(trial_names(damaged).values()),
        robot=model,
        healthy=healthy,
        damaged=damaged,
        diagnoses=(found,),
        comparator=comparator_choice(name)(model, [*healthy, *damaged]).comparator,
        calibration=recorded_calibration(
            diagnosis, file.result, model, healthy, threads=count, words=(file.WHAT, file.REMEDY)
        ),
        made_with=logs[0].software,
        threads=count,
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
