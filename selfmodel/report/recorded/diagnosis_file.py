"""A diagnosis in a JSON file, and the logs that it is of."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path, PurePath
from typing import Any

from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.diagnosis.serialization import diagnosis_from_output
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.files import file_digest
from selfmodel.logs.result_files import read_result
from selfmodel.recovery.repertoire.model_digest import Modelled, self_model_digest
from selfmodel.report.run_result import parsed

WHAT = "the output of `selfmodel diagnose --json`, or the result.json of a recovery"

REMEDY = "leave --diagnosis out, and the logs are diagnosed"


@dataclass(frozen=True)
class NamedLog:
    """A log as a diagnosis names it.

    Attributes:
        path: Path at the time of the diagnosis.
        digest: SHA-256 of the file; None if the diagnosis does not have it.
    """

    path: str
    digest: str | None

    @property
    def file(self) -> str:
        """Name of the file without its folder."""
        return PurePath(self.path.replace("\\", "/")).name

    def fitting(self, paths: Sequence[Path], digest_of: Callable[[Path], str]) -> list[Path]:
        """Returns the files that may be this log: by its digest, or else by its path or its name.

        Args:
            paths: The files.
            digest_of: Returns the SHA-256 of a file.
        """
        if self.digest is not None:
            return [path for path in paths if digest_of(path) == self.digest]
        same = [path for path in paths if path == Path(self.path)]
        return same or [path for path in paths if path.name == self.file]


@dataclass(frozen=True)
class DiagnosisFile:
    """A diagnosis in a JSON file.

    Attributes:
        path: The file.
        explained: Logs that the diagnosis explains, in order.
        healthy: Logs of the healthy robot.
        robot: Name of the robot.
        model: Digest of the self-model, ``self_model_digest``; None in a file of an earlier
            version.
        comparator: Name of the comparator.
        kinds: Names of the fault kinds that were searched.
        calibration: JSON values of the calibration; None without one.
        values: All values.
    """

    path: Path
    explained: tuple[NamedLog, ...]
    healthy: tuple[NamedLog, ...]
    robot: str
    model: str | None
    comparator: str
    kinds: tuple[str, ...]
    calibration: Mapping[str, Any] | None
    values: Mapping[str, Any]

    def diagnosis(self, space: HypothesisSpace) -> Diagnosis:
        """Returns the diagnosis.

        Args:
            space: Hypotheses that it may name.

        Raises:
            InputError: A value is missing, or of another type.
        """
        count = len(self.explained)
        found = parsed(
            self.path, lambda: diagnosis_from_output(self.values, count, space.parse), WHAT, REMEDY
        )
        if found.change is not None and not 0 <= found.change.index < count:
            raise InputError(
                f"{self.path}: expected a change in one of {count} trials, got one in trial "
                f"{found.change.index}; {REMEDY}"
            )
        return found

    def matched(self, paths: Sequence[Path]) -> tuple[list[Path], list[Path]]:
        """Returns those of some logs that the diagnosis explains, in its order, and the healthy.

        Args:
            paths: All logs of the diagnosis, in any order.

        Raises:
            InputError: The logs are others than those of the diagnosis.
        """
        found: dict[NamedLog, Path] = {}
        digest_of = cache(file_digest)
        for log in (*self.explained, *self.healthy):
            fitting = log.fitting(paths, digest_of)
            if len(fitting) != 1:
                number = len(fitting) or "none"
                raise self._of_other_logs(paths, f"{number} of them could be {log.path}")
            found[log] = fitting[0]
        others = [str(path) for path in paths if path not in found.values()]
        if others:
            raise self._of_other_logs(paths, f"{', '.join(others)} is no log of it")
        return [found[log] for log in self.explained], [found[log] for log in self.healthy]

    def check_self_model(self, robot: Modelled) -> None:
        """Checks that a robot is the self-model of the diagnosis, by its name and its digest.

        Args:
            robot: The nominal robot.

        Raises:
            InputError: It is another one.
        """
        if robot.name != self.robot:
            raise InputError(
                f"{self.path} is a diagnosis of the robot {self.robot}, and these logs are of the "
                f"robot {robot.name}: give --robot as it was given to the diagnosis"
            )
        given = self_model_digest(robot)
        if self.model is not None and self.model != given:
            raise InputError(
                f"{self.path} is a diagnosis with another self-model of the name {self.robot}: "
                f"expected the digest {self.model[:12]}, got {given[:12]}: give --robot as it was "
                f"given to the diagnosis, or {REMEDY}"
            )

    def notes(self) -> tuple[str, ...]:
        """Returns what could not be checked, as sentences."""
        if self.model is not None:
            return ()
        note = (
            f"{self.path} is of an earlier version, which did not record the self-model: that of "
            f"this report has the same name, {self.robot}, and may be another"
        )
        return (note,)

    def _of_other_logs(self, paths: Sequence[Path], reason: str) -> InputError:
        own = ", ".join(log.path for log in (*self.explained, *self.healthy))
        by = "SHA-256" if all(log.digest for log in self.explained) else "name"
        return InputError(
            f"{self.path} is a diagnosis of other logs: expected {own}, the same by {by}, got "
            f"{', '.join(map(str, paths))}; {reason}: give these logs, or {REMEDY}"
        )


def read_diagnosis_file(path: Path) -> DiagnosisFile:
    """Returns the diagnosis that ``diagnose --json`` printed, or of a run's ``result.json``.

    Raises:
        InputError: The file cannot be read, or is no such file, or was altered.
    """
    values = read_result(path, WHAT, REMEDY).content
    return parsed(path, lambda: _file(path, values), WHAT, REMEDY)


def _file(path: Path, values: Mapping[str, Any]) -> DiagnosisFile:
    explained, healthy = _logs(values)
    if not explained:
        raise ValueError("it names no log that it explains")
    return DiagnosisFile(
        path=path,
        explained=explained,
        healthy=healthy,
        robot=str(values["robot"]),
        model=None if values.get("model") is None else str(values["model"]),
        comparator=str(values["comparator"]),
        kinds=tuple(str(kind) for kind in values["kinds"]),
        calibration=values["calibration"],
        values=values,
    )


def _logs(values: Mapping[str, Any]) -> tuple[tuple[NamedLog, ...], tuple[NamedLog, ...]]:
    """Returns the explained logs and those of the healthy robot."""
    files = {str(path): str(digest) for path, digest in values.get("files", {}).items()}
    if "logs" in values:
        explained, healthy = values["logs"], values["intact"]
    else:
        rows = values["trials"]
        explained = [row["log"] for row in rows if row["stage"] != "before"]
        healthy = [row["log"] for row in rows if row["stage"] == "before"]
    return _named(explained, files), _named(healthy, files)


def _named(paths: Sequence[object], files: Mapping[str, str]) -> tuple[NamedLog, ...]:
    """Returns logs with their digests, whose paths are relative to the folder in a result.json."""
    ends = {NamedLog(path, None).file: digest for path, digest in files.items()}
    logs = [NamedLog(str(path), None) for path in paths]
    return tuple(NamedLog(log.path, files.get(log.path) or ends.get(log.file)) for log in logs)
