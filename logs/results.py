"""Results as files: what ``recover`` and ``diagnose`` write and reports read, by the same classes.

The fields are the keys of the JSON, which is a published format. A file may have more keys, such as
those of another version.
"""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path, PurePath
from typing import Annotated, Any, TypeVar

import msgspec
from msgspec import UNSET, Meta, Struct, UnsetType

from selfmodel.diagnosis.diagnosis import renamed
from selfmodel.errors import InputError
from selfmodel.files import read_file
from selfmodel.logs.files import replace_file
from selfmodel.logs.result_files import MAX_BYTES, parse_json, read_result, verified
from selfmodel.settings import Settings

RESULT = "result.json"
"""File of the result of a recovery, in the folder of its run."""

SEARCHES = "searches.json"
"""File of the progress of all searches of a recovery, likewise."""

Read = TypeVar("Read")

ContactFactor = Annotated[float, Meta(ge=0.01, le=100)]


class Search(Struct, frozen=True):
    """Progress of one search of a recovery.

    Attributes:
        kind: Name of the EA: ``repair`` or ``diagnostic``.
        hypothesis: Notation of the hypothesis that a repair compensates; "" for a diagnosis.
        best: Best fitness after each generation; None where every simulation diverged.
        evaluations: Number of evaluations after each generation.
    """

    kind: str
    hypothesis: str
    best: tuple[float | None, ...]
    evaluations: tuple[int, ...]


class TrialResult(Struct, frozen=True):
    """Result of a trial of a recovery.

    Attributes:
        log: Path of its log.
        stage: Stage of the recovery.
        displacement: Forward displacement, m.
        steps: Number of control steps.
        ended_early: Whether the trial was stopped.
        score: Score of the trial; None if unknown.
        predicted_score: Score that was predicted before the trial; None if none was.
        fell_at_step: Step at which the robot fell; None if it did not.
        hypothesis: Best hypothesis at the time, in notation.
    """

    log: str
    stage: str
    displacement: float | None = None
    steps: int | None = None
    ended_early: bool | None = None
    score: float | None = None
    predicted_score: float | None = None
    fell_at_step: int | None = None
    hypothesis: str = ""

    @property
    def name(self) -> str:
        """Name of the log's file without its ending."""
        return PurePath(self.log.replace("\\", "/")).stem


class ScoreResult(Struct, frozen=True):
    """The score of a recovery.

    Attributes:
        name: Name of the score.
        unit: Unit; "" without one.
        before: Score before the failure; None if it is no number.
        after: Score of the same controller after the failure.
        recovered: Largest score of the trials since.
    """

    name: str
    unit: str
    before: float | None
    after: float | None
    recovered: float | None


class DiagnosisResult(Struct, frozen=True, kw_only=True):
    """A diagnosis, as in the result of a recovery and in the output of ``diagnose --json``.

    ``diagnosis.diagnosis.output_of`` has the meaning of ``diagnosis``, and of all from ``verdict``
    to ``detectable``; ``Calibration.to_dict`` that of ``calibration``.

    Attributes:
        robot: Name of the robot.
        model: Digest of the self-model, ``self_model_digest``.
        comparator: Name of the comparator.
        comparator_reason: Reason for its choice.
        kinds: Names of the fault kinds that were searched.
        seed: Seed of all random numbers.
        calibration: The calibration; None without one.
        files: SHA-256 of each log, by its path.
        logs: Paths of the logs that a diagnosis of logs explains, in order.
        intact: Paths of its logs of the healthy robot.
        trials: Trials of a recovery, in order.
        seconds: Wall time, s.
    """

    robot: str
    model: str
    comparator: str
    comparator_reason: str = ""
    kinds: tuple[str, ...]
    seed: int = 0
    calibration: dict[str, Any] | None
    diagnosis: Annotated[list[dict[str, Any]], Meta(min_length=1)]
    verdict: str
    indistinguishable: list[str]
    undetectable: list[str]
    test: str
    unsearched: dict[str, Any] | None = None
    intact_distance: float | None
    reason: str | None = None
    fit: dict[str, Any] | None = None
    change: dict[str, Any] | None = None
    residual: dict[str, Any] | None = None
    detectable: list[dict[str, Any]] | UnsetType = UNSET
    files: dict[str, str] | UnsetType = UNSET
    logs: tuple[str, ...] | UnsetType = UNSET
    intact: tuple[str, ...] | UnsetType = UNSET
    trials: tuple[TrialResult, ...] | UnsetType = UNSET
    seconds: float = 0.0

    @property
    def explained(self) -> tuple[str, ...]:
        """Paths of the logs that the diagnosis explains, in order."""
        return (self.logs or ()) + tuple(
            trial.log for trial in self.trials or () if trial.stage != "before"
        )

    @property
    def healthy(self) -> tuple[str, ...]:
        """Paths of the logs of the healthy robot."""
        return (self.intact or ()) + tuple(
            trial.log for trial in self.trials or () if trial.stage == "before"
        )


class LogsResult(DiagnosisResult, frozen=True, kw_only=True):
    """Output of ``diagnose --json``.

    Attributes:
        settings_from: Path of the log with the settings of the search.
        played_back: Paths of the logs without a controller.
        evidence: Evidence that needs no simulation, by trial.
        evaluations: Number of evaluations of the EA.
        distinct_hypotheses: Number of distinct hypotheses.
    """

    settings_from: str
    played_back: tuple[str, ...]
    evidence: list[dict[str, Any]]
    evaluations: int
    distinct_hypotheses: int


class RecoveryResult(DiagnosisResult, frozen=True, kw_only=True):
    """Outcome of a recovery of a simulated robot: ``recover --json``, and its ``result.json``.

    Attributes:
        truth: True faults, in notation.
        gap: Level of the reality gap.
        correct: Whether the last diagnosis is right.
        score: The score.
        fell: Whether the robot fell in its best trial.
        physical_trials: Number of trials since the failure.
        case: Number of the failure in Table I; None for a failure that is not in it.
        structure: False; a key of version 0.1.
        next_trial: Choice of each trial after the failing one.
        repair: Name of the repair.
        search: Name of its search.
        repertoire: Origin of the repertoire; None without one.
        controller: Name of the controller design.
        neurons: Number of hidden neurons.
        displacement: Forward displacement before and after the failure, and recovered, m.
        recovery: Recovered displacement as a share of that before; None if that is not positive.
        evaluations: Number of evaluations, by the EA, and of simulations.
        settings: Parameters of the recovery, of ``result.json``.
    """

    truth: str
    gap: float
    correct: bool
    score: ScoreResult
    fell: bool
    physical_trials: int
    case: int | None = None
    structure: bool = False
    next_trial: str = ""
    repair: str = ""
    search: str | None = None
    repertoire: dict[str, Any] | None = None
    controller: str = ""
    neurons: int | None = None
    displacement: dict[str, float | None] = {}  # a struct copies it
    recovery: float | None = None
    evaluations: dict[str, int] = {}
    settings: dict[str, Any] | UnsetType = UNSET

    def as_file(self, settings: Settings, files: dict[str, str]) -> dict[str, Any]:
        """Returns the content of ``result.json``, with settings and digests of the logs."""
        whole = msgspec.structs.replace(self, settings=asdict(settings), files=files)
        return as_json(whole)


class CalibrationResult(Struct, frozen=True):
    """The part of a calibration's JSON of which a self-model is made, ``Calibration.to_dict``.

    With ``joints``, the fit of a robot with a fixed
    base, the other values do not determine the self-model.
    """

    root_mass: float
    limb_mass: float
    friction: float
    damping: float
    motor_gains: tuple[float, ...]
    delay: float
    deviations: tuple[float, ...]
    error_before: float
    error: float
    set: str
    determined: tuple[bool, ...]
    held_out_gain: float
    contact_stiffness: ContactFactor
    contact_damping: ContactFactor
    joints: dict[str, Any] | None = None


def as_json(result: Struct) -> dict[str, Any]:
    """Returns the JSON values of a result."""
    found: dict[str, Any] = msgspec.to_builtins(result)
    return found


def converted(path: Path, values: object, kind: type[Read], what: str, remedy: str) -> Read:
    """Returns JSON values as an object of a class.

    Args:
        path: Their file, for the error.
        values: The values.
        kind: The class.
        what: Expected content, for the error.
        remedy: Remedy, for the error.
    """
    try:
        return msgspec.convert(values, kind)
    except msgspec.ValidationError as error:
        raise InputError(f"{path}: expected {what}: {error}; {remedy}") from error


def read_as(path: Path, kind: type[Read], what: str, remedy: str) -> Read:
    """Returns the content of a result file, whose digest is checked; see ``converted``."""
    content = renamed(read_result(path, what, remedy).content)
    return converted(path, content, kind, what, remedy)


def write_searches(folder: Path, searches: Sequence[Search]) -> None:
    """Writes the progress of searches into the folder of a run."""
    # JSON has no infinity, which is the fitness if every simulation diverged: it is null.
    replace_file(folder / SEARCHES, msgspec.json.format(msgspec.json.encode(searches), indent=1))


def read_searches(folder: Path) -> tuple[Search, ...]:
    """Returns the progress in the folder of a run; none if it was not recorded."""
    path = folder / SEARCHES
    if not path.exists():
        return ()
    what = "the progress of the searches of a run"
    remedy = "move it away, and the report is made without it"
    try:
        values = parse_json(read_file(path, what, MAX_BYTES))
    except ValueError as error:
        raise InputError(f"{path}: expected {what}: {error}; {remedy}") from error
    return converted(path, values, tuple[Search, ...], what, remedy)


def best_hypothesis(path: Path) -> str:
    """Returns the notation of the best hypothesis of a diagnosis.

    Args:
        path: ``result.json`` or ``diagnoses.json`` of a recovery (the last diagnosis counts), or
            the output of ``diagnose --json`` or ``recover --json``.
    """
    what = (
        "a diagnosis: the result.json or diagnoses.json of a recovery, or the output of selfmodel "
        "diagnose --json"
    )
    remedy = "name the hypothesis by --hypothesis"
    try:
        values = parse_json(read_file(path, what, MAX_BYTES))
        found = values if isinstance(values, list) else verified(values).content
    except ValueError as error:
        raise InputError(f"{path}: expected {what}: {error}; {remedy}") from error
    if isinstance(found, list):
        return converted(path, found, _Journal, what, remedy)[-1].ranked[0].hypothesis
    return converted(path, found, _Printed, what, remedy).diagnosis[0].hypothesis


class _Candidate(Struct):
    hypothesis: str


_Ranking = Annotated[list[_Candidate], Meta(min_length=1)]


class _Printed(Struct):
    diagnosis: _Ranking


class _Logged(Struct):
    ranked: _Ranking


_Journal = Annotated[list[_Logged], Meta(min_length=1)]
