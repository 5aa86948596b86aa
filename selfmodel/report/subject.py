"""What a report is about: trials of one robot, their diagnoses, and the self-model behind them.

A subject is read from the folder of a run, or from logs and the file of their diagnosis. No name in
a file is imported: plug-ins that are no entry points have to be given.
"""

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path, PurePath
from typing import Generic, TypeVar

import numpy as np

from selfmodel import arguments, plugins
from selfmodel.arguments import AUTO, comparator_choice, fitted
from selfmodel.diagnosis.comparator import Comparator
from selfmodel.diagnosis.diagnosis import Diagnosis, diagnosis_from_dict
from selfmodel.diagnosis.losses import LossTable
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.registry import ALL_KINDS
from selfmodel.files import encodable, file_digest
from selfmodel.logs.journal import (
    DIAGNOSES,
    RECOVERY,
    TRIALS,
    is_calibrated,
    read_diagnoses,
    trial_order,
)
from selfmodel.logs.results import (
    RESULT,
    CalibrationResult,
    DiagnosisResult,
    RecoveryResult,
    Search,
    as_json,
    converted,
    read_as,
    read_searches,
)
from selfmodel.recovery.repertoire import self_model_digest
from selfmodel.robot.robot import Robot
from selfmodel.simulation.calibration import Calibration
from selfmodel.simulation.fit import NOMINAL
from selfmodel.simulation.log_check import Suspicion
from selfmodel.simulation.model_factors import Parameters, factor_names, with_parameters
from selfmodel.simulation.simulator import Simulator, thread_count
from selfmodel.trials.trial import Trial, by_stage, trial_names

Result = TypeVar("Result", bound=DiagnosisResult)


@dataclass(frozen=True, eq=False)
class Subject:
    """Trials of one robot, and what is known about them.

    Attributes:
        name: Name of the run or of the logs.
        healthy: Trials of the healthy robot.
        damaged: Trials to explain, in order.
        diagnoses: At least one; the last is of all trials to explain.
        result: Result of a run; None for logs, and for a run that is not finished.
        searches: Progress of the searches; empty if it was not recorded.
        made_with: Versions by the name of the software.
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
        ranked = (candidate.hypothesis for candidate in self.diagnosis.ranked)
        others = (*self.diagnosis.indistinguishable, *ranked)
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
    """Returns whether a folder is that of a run with at least one diagnosis; of a study or not."""
    place = _place_of(folder)
    return (place / TRIALS).is_dir() and (place / DIAGNOSES).is_file()


def _place_of(run: Path) -> Path:
    """Returns the folder with the trials of a run: of one in a study, the folder inside it."""
    return run / RECOVERY if (run / RECOVERY).is_dir() else run


def subject_of_run(
    folder: Path, threads: int = 0, comparator: str = AUTO, kinds: Sequence[FaultKind] = ()
) -> Subject:
    """Returns the subject of a report on a run.

    Without a ``result.json``, as of a run that is not finished or was interrupted, the comparator
    is the best one for the trials, and the self-model is fitted to the healthy trials, unless the
    run was begun without calibration.

    Args:
        folder: Folder of the run, or of a run of a study, ``STUDY/runs/NAME``.
        threads: Threads of the physics; 0 for all processors.
        comparator: Name of the comparator of the run, which may be ``package.module:object``;
            ``auto`` for that of its result.
        kinds: Fault kinds of the run that are no entry points.
    """
    name, folder = folder.resolve().name, _place_of(folder)
    paths = sorted((folder / TRIALS).glob("*.mcap"), key=trial_order)
    if not paths:
        raise InputError(f"{folder}: expected the folder of a run with logs in {TRIALS}, got none")
    logs = arguments.read_logs(paths)
    robot = arguments.robot_of_logs(logs, None)
    damaged, healthy = by_stage([log.trial for log in logs])
    count, space = thread_count(threads), _hypothesis_space(robot, kinds)
    file = DiagnosisFile(folder / RESULT, RecoveryResult) if (folder / RESULT).exists() else None
    if file is not None:
        comparator, space = file.comparator_name(comparator), file.space(robot, kinds)
    diagnoses = read_diagnoses(folder, space)
    if not diagnoses or not damaged:
        raise InputError(
            f"{folder}: expected a run with a diagnosis, got none yet: wait for its first "
            f"diagnosis, or give its logs"
        )
    _check_counts(folder, diagnoses, len(damaged))
    explained = damaged[: diagnoses[-1].trials]
    if file is not None:
        calibration = file.calibration(robot, healthy, count)
    else:
        calibration = fitted(robot, healthy, count) if healthy and is_calibrated(folder) else None
    return Subject(
        name=name,
        robot=robot,
        healthy=tuple(healthy),
        damaged=tuple(explained),
        diagnoses=diagnoses,
        comparator=comparator_choice(comparator)(robot, [*healthy, *explained]).comparator,
        calibration=calibration,
        result=None if file is None else file.result,
        searches=read_searches(folder),
        made_with=logs[0].software,
        threads=count,
    )


def _check_counts(folder: Path, diagnoses: Sequence[Diagnosis], trials: int) -> None:
    """Checks that each diagnosis, and its change, is of logs that a damaged run still has."""
    for diagnosis in diagnoses:
        change = diagnosis.change
        index = 0 if change is None else change.index
        if not (1 <= diagnosis.trials <= trials and 0 <= index < diagnosis.trials):
            place = "" if change is None else f", with a change in trial {index}"
            raise InputError(
                f"{folder / DIAGNOSES}: expected diagnoses of 1 to {trials} trials, as many as the "
                f"folder {TRIALS} has after the failure, got one of {diagnosis.trials}{place}: put "
                f"back the logs that were moved away, or give the logs instead of the folder"
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
    """Returns the subject of a report on logs, in any order, that were diagnosed before.

    The diagnosis is the output of ``selfmodel diagnose --json``, or the ``result.json`` of a
    recovery. A robot is the self-model instead of that in the logs, as in ``--robot`` of the
    diagnosis. The other arguments are as of ``subject_of_run``.
    """
    file = DiagnosisFile(diagnosis, DiagnosisResult)
    explained, intact = file.matched(paths)
    logs = arguments.read_logs([*explained, *intact])
    model = arguments.robot_of_logs(logs, robot)
    file.check_self_model(model)
    explanation = file.diagnosis(file.space(model, kinds))
    trials = [log.trial for log in logs]
    damaged, healthy = tuple(trials[: len(explained)]), tuple(trials[len(explained) :])
    name, count = file.comparator_name(comparator), thread_count(threads)
    return Subject(
        name=", ".join(trial_names(damaged).values()),
        robot=model,
        healthy=healthy,
        damaged=damaged,
        diagnoses=(explanation,),
        comparator=comparator_choice(name)(model, [*healthy, *damaged]).comparator,
        calibration=file.calibration(model, healthy, count),
        made_with=logs[0].software,
        threads=count,
    )


def _hypothesis_space(robot: Robot, kinds: Iterable[FaultKind]) -> HypothesisSpace:
    return HypothesisSpace(robot.anatomy, tuple(dict.fromkeys((*ALL_KINDS, *kinds))))


WORDS = {
    DiagnosisResult: (
        "the output of `selfmodel diagnose --json`, or the result.json of a recovery",
        "leave --diagnosis out, and the logs are diagnosed",
    ),
    RecoveryResult: (
        "the result of a recovery",
        "move it away, and the report is made of the logs and diagnoses",
    ),
}
"""What a file is expected to be, and the remedy if it is not, by the class of its content."""


class DiagnosisFile(Generic[Result]):
    """A diagnosis in a JSON file: the logs that it is of, its plug-ins, its calibration.

    The class of the content is that of the output of ``diagnose --json``, or of ``result.json``.
    """

    def __init__(self, path: Path, kind: type[Result]) -> None:
        self.path, (self._what, self._remedy) = path, WORDS[kind]
        self.result = read_as(path, kind, self._what, self._remedy)
        if not self.result.explained:
            raise self._error("it explains no log")

    def _error(self, cause: str) -> InputError:
        return InputError(f"{self.path}: expected {self._what}: {cause}; {self._remedy}")

    def diagnosis(self, space: HypothesisSpace) -> Diagnosis:
        """Returns the diagnosis, of hypotheses of a space."""
        count = len(self.result.explained)
        try:
            diagnosis = diagnosis_from_dict({**as_json(self.result), "trials": count}, space.parse)
        except (LookupError, TypeError, ValueError, AttributeError, OverflowError) as error:
            raise self._error(f"{type(error).__name__}: {error}") from error
        if diagnosis.change is not None and not 0 <= diagnosis.change.index < count:
            raise self._error(f"a change in trial {diagnosis.change.index} of {count} trials")
        return diagnosis

    def matched(self, paths: Sequence[Path]) -> tuple[list[Path], list[Path]]:
        """Returns those of some logs that the diagnosis explains, in its order, and the healthy.

        The logs are in any order and under any names, and are those of the diagnosis.
        """
        given, files = {file_digest(path): path for path in paths}, self.result.files or {}
        # The paths in a result.json are relative to its folder, and those of its logs are not.
        known = {PurePath(path).name: digest for path, digest in files.items()} | files
        explained, healthy = (
            [known.get(log) or known.get(PurePath(log).name, "") for log in logs]
            for logs in (self.result.explained, self.result.healthy)
        )
        if len(given) != len(paths) or given.keys() != {*explained, *healthy}:
            expected = ", ".join((*self.result.explained, *self.result.healthy))
            raise InputError(
                f"{self.path} is a diagnosis of other logs: expected {expected}, the same by "
                f"SHA-256, got {', '.join(map(str, paths))}: give these logs, or {self._remedy}"
            )
        return [given[digest] for digest in explained], [given[digest] for digest in healthy]

    def check_self_model(self, robot: Robot) -> None:
        """Checks that a robot is the self-model of the diagnosis, by its name and its digest."""
        if robot.name != self.result.robot:
            raise InputError(
                f"{self.path} is a diagnosis of the robot {self.result.robot}, and these logs are "
                f"of the robot {robot.name}: give --robot as it was given to the diagnosis"
            )
        given, model = self_model_digest(robot), self.result.model
        if model != given:
            raise InputError(
                f"{self.path} is a diagnosis with another self-model of the name {robot.name}: "
                f"expected the digest {model[:12]}, got {given[:12]}: give --robot as it was given "
                f"to the diagnosis, or {self._remedy}"
            )

    def comparator_name(self, given: str) -> str:
        """Returns the name by which the recorded comparator is found: that of ``--comparator``."""
        recorded = self.result.comparator
        if given == AUTO:
            return self._installed(recorded)
        name = plugins.comparator(given).name
        if name != recorded:
            raise InputError(
                f"{self.path} has distances by the comparator {recorded}, and --comparator {given} "
                f"is {name}: leave --comparator out, which is for a comparator "
                f"package.module:object"
            )
        return given

    def space(self, robot: Robot, given: Sequence[FaultKind]) -> HypothesisSpace:
        """Returns the hypotheses of built-in kinds, of those in the file, and of given ones."""
        known = {kind.name for kind in given}
        named = [self._installed(name) for name in self.result.kinds if name not in known]
        recorded = plugins.kinds(",".join(named)) if named else ()
        return _hypothesis_space(robot, (*recorded, *given))

    def _installed(self, name: str) -> str:
        """Returns a name that imports no code: a file of others may name any module."""
        if ":" in name:
            raise InputError(
                f"{self.path} names the plug-in {name!r}, and a report imports nothing that a file "
                f"names: name it by --comparator or --kinds, or give it an entry point"
            )
        return name

    def calibration(
        self, robot: Robot, healthy: Sequence[Trial], threads: int
    ) -> Calibration | None:
        """Returns the calibration; None without healthy trials or without one.

        Values of a fit joint by joint do not determine its model: it is fitted again.
        """
        values = self.result.calibration
        if not healthy or values is None:
            return None
        fit = converted(self.path, values, CalibrationResult, self._what, self._remedy)
        if fit.joints is not None:
            return fitted(robot, healthy, threads)
        # Factors of single joints and bodies are of other fits, and stay nominal.
        names = {one.name for one in dataclasses.fields(Parameters)} & set(fit.__struct_fields__)
        parameters = Parameters(**{name: getattr(fit, name) for name in names})
        count = len(factor_names(robot))
        sizes = {len(parameters.factors), len(fit.deviations), len(fit.determined) or count}
        if sizes != {count}:
            raise self._error(
                f"its calibration has {sorted(sizes)} factors, and {count} are expected"
            )
        doubt = fit.suspicion
        return Calibration(
            robot=robot if fit.set == NOMINAL else with_parameters(robot, parameters),
            parameters=parameters,
            deviations=np.array(fit.deviations),
            error_before=fit.error_before,
            error=fit.error,
            chosen=fit.set,
            determined=fit.determined,
            held_out_gain=fit.held_out_gain,
            suspicion=None if doubt is None else Suspicion(doubt.joint, doubt.cause),
        )
