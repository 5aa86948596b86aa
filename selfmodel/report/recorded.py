"""A diagnosis in a file: the logs that it is of, its plug-ins, its calibration.

No name in a file is imported: plug-ins that are no entry points have to be given.
"""

import dataclasses
from collections.abc import Iterable, Sequence
from pathlib import Path, PurePath

import numpy as np

from selfmodel import plugins
from selfmodel.arguments import AUTO, fitted
from selfmodel.diagnosis.diagnosis import Diagnosis, diagnosis_from_dict
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.registry import ALL_KINDS
from selfmodel.files import file_digest
from selfmodel.logs.results import (
    CalibrationResult,
    DiagnosisResult,
    as_json,
    converted,
    read_as,
)
from selfmodel.recovery.repertoire import self_model_digest
from selfmodel.robot.robot import Robot
from selfmodel.simulation.calibration import Calibration
from selfmodel.simulation.fit import NOMINAL
from selfmodel.simulation.model_factors import Parameters, factor_names, with_parameters
from selfmodel.trials.trial import Trial


class DiagnosisFile:
    """A diagnosis in a JSON file, and the logs that it is of.

    Args:
        path: Output of ``diagnose --json``, or a run's ``result.json``.

    Raises:
        InputError: The file cannot be read, or is no such file, or was altered.
    """

    WHAT = "the output of `selfmodel diagnose --json`, or the result.json of a recovery"
    REMEDY = "leave --diagnosis out, and the logs are diagnosed"

    def __init__(self, path: Path) -> None:
        self.path = path
        self.result = read_as(path, DiagnosisResult, self.WHAT, self.REMEDY)
        if not self.result.explained:
            raise InputError(
                f"{path}: expected {self.WHAT}, got one that explains no log; {self.REMEDY}"
            )

    def diagnosis(self, space: HypothesisSpace) -> Diagnosis:
        """Returns the diagnosis.

        Args:
            space: Hypotheses that it may name.

        Raises:
            InputError: A value is missing, or of another type.
        """
        count = len(self.result.explained)
        try:
            values = {**as_json(self.result), "trials": count}
            found = diagnosis_from_dict(values, space.parse)
        except (LookupError, TypeError, ValueError, AttributeError, OverflowError) as error:
            cause = f"{type(error).__name__}: {error}"
            raise InputError(
                f"{self.path}: expected {self.WHAT}: {cause}; {self.REMEDY}"
            ) from error
        if found.change is not None and not 0 <= found.change.index < count:
            raise InputError(
                f"{self.path}: expected a change in one of {count} trials, got one in trial "
                f"{found.change.index}; {self.REMEDY}"
            )
        return found

    def matched(self, paths: Sequence[Path]) -> tuple[list[Path], list[Path]]:
        """Returns those of some logs that the diagnosis explains, in its order, and the healthy.

        Args:
            paths: All logs of the diagnosis, in any order and under any names.

        Raises:
            InputError: The logs are others than those of the diagnosis.
        """
        given = {file_digest(path): path for path in paths}
        # The paths in a result.json are relative to its folder, and those of its logs are not.
        known = {PurePath(path).name: digest for path, digest in (self.result.files or {}).items()}
        known |= self.result.files or {}
        explained, healthy = (
            [known.get(log) or known.get(PurePath(log).name, "") for log in logs]
            for logs in (self.result.explained, self.result.healthy)
        )
        if len(given) != len(paths) or given.keys() != {*explained, *healthy}:
            own = ", ".join((*self.result.explained, *self.result.healthy))
            raise InputError(
                f"{self.path} is a diagnosis of other logs: expected {own}, the same by SHA-256, "
                f"got {', '.join(map(str, paths))}: give these logs, or {self.REMEDY}"
            )
        return [given[digest] for digest in explained], [given[digest] for digest in healthy]

    def check_self_model(self, robot: Robot) -> None:
        """Checks that a robot is the self-model of the diagnosis, by its name and its digest.

        Raises:
            InputError: It is another one.
        """
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
                f"to the diagnosis, or {self.REMEDY}"
            )


def comparator_name(path: Path, recorded: str, given: str) -> str:
    """Returns the name by which the recorded comparator is found.

    Args:
        path: The file.
        recorded: Name of the comparator in the file.
        given: Name of ``--comparator``: where the recorded comparator is, such as
            ``package.module:object``; ``auto`` for one that its own name finds.

    Raises:
        InputError: The given comparator is another than the recorded one, or the file names a
            module.
    """
    if given == AUTO:
        return _installed(path, recorded)
    name = plugins.comparator(given).name
    if name != recorded:
        raise InputError(
            f"{path} has distances by the comparator {recorded}, and --comparator {given} is "
            f"{name}: leave --comparator out, which is for a comparator package.module:object"
        )
    return given


def recorded_space(
    path: Path, robot: Robot, recorded: Iterable[str], given: Sequence[FaultKind]
) -> HypothesisSpace:
    """Returns the hypotheses of built-in kinds, of those in a file, and of those of ``--kinds``.

    Raises:
        InputError: The file names a module, or no kind has a name.
    """
    known = {kind.name for kind in given}
    named = [_installed(path, name) for name in recorded if name not in known]
    found = plugins.kinds(",".join(named)) if named else ()
    return HypothesisSpace(robot.anatomy, tuple(dict.fromkeys((*ALL_KINDS, *found, *given))))


def _installed(path: Path, name: str) -> str:
    """Returns a name that imports no code: a file of others may name any module.

    Raises:
        InputError: The name is that of a module.
    """
    if ":" in name:
        raise InputError(
            f"{path} names the plug-in {name!r}, and a report imports nothing that a file names: "
            f"name it by --comparator or --kinds, or give it an entry point"
        )
    return name


def recorded_calibration(
    path: Path,
    result: DiagnosisResult,
    robot: Robot,
    healthy: Sequence[Trial],
    *,
    threads: int,
    words: tuple[str, str],
) -> Calibration | None:
    """Returns the calibration in a file; None without healthy trials or without one.

    Values of a fit joint by joint do not determine its model: it is fitted again.

    Args:
        path: The file.
        result: Its content.
        robot: The nominal robot.
        healthy: Trials of the healthy robot.
        threads: Threads of the physics.
        words: Expected content and remedy, for the error.

    Raises:
        InputError: A value is missing, of another type, or of another robot.
    """
    if not healthy or result.calibration is None:
        return None
    what, remedy = words
    fit = converted(path, result.calibration, CalibrationResult, what, remedy)
    if fit.joints is not None:
        return fitted(robot, healthy, threads)
    # Factors of single joints and bodies are of other fits, and stay nominal.
    names = {field.name for field in dataclasses.fields(Parameters)} & set(fit.__struct_fields__)
    parameters = Parameters(**{name: getattr(fit, name) for name in names})
    count = len(factor_names(robot))
    sizes = {len(parameters.factors), len(fit.deviations), len(fit.determined) or count}
    if sizes != {count}:
        raise InputError(
            f"{path}: expected {what}: its calibration has {sorted(sizes)} factors, and {count} "
            f"are expected; {remedy}"
        )
    return Calibration(
        robot=robot if fit.set == NOMINAL else with_parameters(robot, parameters),
        parameters=parameters,
        deviations=np.array(fit.deviations),
        error_before=fit.error_before,
        error=fit.error,
        chosen=fit.set,
        determined=fit.determined,
        held_out_gain=fit.held_out_gain,
    )
