"""Result files: what ``recover`` and ``diagnose`` write and reports read, by the same classes.

The fields are the keys of the JSON, which is a published format; a file may have more keys, such as
those of another version. Besides its content, a result file has the keys ``made_with``, the
versions of selfmodel, MuJoCo and numpy, and ``sha256``, the SHA-256 of all its other values in a
canonical form. The digest detects damage and changes by hand; it is no signature. Files of version
0.1 have neither key.
"""

import dataclasses
import hashlib
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from importlib.metadata import version
from os.path import relpath
from pathlib import Path, PurePath
from typing import Annotated, Any, TypeVar

import msgspec
from msgspec import UNSET, Meta, Struct, UnsetType
from msgspec.structs import replace

from selfmodel.diagnosis.diagnosis import renamed
from selfmodel.errors import InputError
from selfmodel.files import file_digest, read_file
from selfmodel.logs.files import replace_file
from selfmodel.settings import RepairSettings, Settings

MAX_BYTES = 16 * 2**20
"""Largest JSON file that is written and read, bytes."""

MADE_WITH, DIGEST = "made_with", "sha256"

RESULT, SEARCHES = "result.json", "searches.json"
"""Files in the folder of a recovery: its result, and the progress of all its searches."""

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
    """Result of a trial of a recovery; what is unknown is None.

    Attributes:
        log: Path of its log.
        stage: Stage of the recovery.
        displacement: Forward displacement, m.
        steps: Number of control steps.
        ended_early: Whether the trial was stopped.
        score: Score of the trial.
        predicted_score: Score that was predicted before the trial, by one simulation without noise
            under the best hypothesis at the time.
        robust_mean: Mean score of its controller in the last simulations of its repair.
        fell_at_step: Step at which the robot fell.
        reward_sum: Return of the trial, of a robot with a task.
        hypothesis: Best hypothesis at the time, in notation.
    """

    log: str
    stage: str
    displacement: float | None = None
    steps: int | None = None
    ended_early: bool | None = None
    score: float | None = None
    predicted_score: float | None = None
    robust_mean: float | None = None
    fell_at_step: int | None = None
    reward_sum: float | None = msgspec.field(default=None, name="return")
    hypothesis: str = ""

    @property
    def name(self) -> str:
        """Name of the log's file without its ending."""
        return PurePath(self.log.replace("\\", "/")).stem


class ScoreResult(Struct, frozen=True):
    """The score of a recovery before and after the failure, with the same controller, and since.

    ``most`` is the largest return that trials of this length can have; None for other scores.
    """

    name: str
    unit: str
    before: float | None
    after: float | None
    recovered: float | None
    most: int | None = None


class DiagnosisResult(Struct, frozen=True, kw_only=True):
    """A diagnosis, as in the result of a recovery and in the output of ``diagnose --json``.

    ``diagnosis.diagnosis.output_of`` has the meaning of ``diagnosis``, and of all from ``verdict``
    to ``detectable``; ``Calibration.to_dict`` that of ``calibration``.

    Attributes:
        model: Digest of the self-model, ``self_model_digest``.
        comparator: Name of the comparator, for ``comparator_reason``.
        kinds: Names of the fault kinds that were asked for.
        summary: What is wrong, since when, how sure that is, and what to do.
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
    also_searched: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    cost: dict[str, int] = {}  # a struct copies it
    intact_distance: float | None
    reason: str | None = None
    summary: str = ""
    probability: dict[str, float] = {}  # a struct copies it
    fit: dict[str, Any] | None = None
    change: dict[str, Any] | None = None
    residual: dict[str, Any] | None = None
    doubt: dict[str, Any] | None = None
    detectable: list[dict[str, Any]] | UnsetType = UNSET
    files: dict[str, str] | UnsetType = UNSET
    logs: tuple[str, ...] | UnsetType = UNSET
    intact: tuple[str, ...] | UnsetType = UNSET
    trials: tuple[TrialResult, ...] | UnsetType = UNSET
    seconds: float = 0.0

    @property
    def explained(self) -> tuple[str, ...]:
        """Paths of the logs that the diagnosis explains, in order."""
        after = (trial.log for trial in self.trials or () if trial.stage != "before")
        return (*(self.logs or ()), *after)

    @property
    def healthy(self) -> tuple[str, ...]:
        """Paths of the logs of the healthy robot."""
        before = (trial.log for trial in self.trials or () if trial.stage == "before")
        return (*(self.intact or ()), *before)


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
        fell: Whether the robot fell in its best trial.
        physical_trials: Number of trials since the failure.
        case: Number of the failure in Table I; None for a failure that is not in it.
        structure: False; a key of version 0.1.
        repertoire: Origin of the repertoire; None without one.
        controller: Name of the controller design, which has ``neurons`` hidden neurons.
        displacement: Forward displacement before and after the failure, and recovered, m.
        recovery: Recovered displacement as a share of that before; None if that is not positive, or
            if the robot fell.
        evaluations: Number of evaluations, by the EA, and of simulations.
        warnings: Where the self-model foresees more than the robot does, with the likely cause.
        settings: Parameters of the recovery, of ``result.json``.
        repair_settings: Those of the repair, where they are others.
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
    warnings: tuple[str, ...] = ()
    settings: dict[str, Any] | UnsetType = UNSET
    repair_settings: dict[str, Any] | UnsetType = UNSET

    def write(
        self, folder: Path, settings: Settings, of_repair: RepairSettings | None = None
    ) -> None:
        """Writes ``result.json``, with settings and digests; its paths are relative to its folder.

        The repair has the settings of the recovery, unless it has its own.
        """
        trials = [replace(one, log=relpath(one.log, folder)) for one in self.trials or ()]
        content = replace(
            self,
            trials=tuple(trials),
            settings=settings.as_json(),
            repair_settings=UNSET if of_repair is None else dataclasses.asdict(of_repair),
            files={one.log: file_digest(folder / one.log) for one in trials},
        )
        replace_file(folder / RESULT, result_bytes(as_json(content)))


class SuspicionResult(Struct, frozen=True):
    """A probable error in the recording of healthy trials, ``Suspicion.to_dict``."""

    joint: str | None
    cause: str


class CalibrationResult(Struct, frozen=True):
    """The part of a calibration's JSON of which a self-model is made, ``Calibration.to_dict``.

    With ``joints``, the fit of a robot with a fixed base, the other values do not determine the
    self-model.
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
    suspicion: SuspicionResult | None = None


def as_json(result: Struct) -> dict[str, Any]:
    """Returns the JSON values of a result."""
    found: dict[str, Any] = msgspec.to_builtins(result)
    return found


# ---------------------------------------------------------------- reading and writing


def result_bytes(content: Mapping[str, Any]) -> bytes:
    """Returns the bytes of a result file, with the installed versions and the digest."""
    # The digest is that of the values as a reader parses them: JSON's keys are texts.
    given = {**content, MADE_WITH: versions()}
    values = parse_json(json.dumps(given, allow_nan=False).encode())
    data = json.dumps({**values, DIGEST: digest_of(values)}, indent=1, allow_nan=False).encode()
    if len(data) > MAX_BYTES:
        raise ValueError(f"expected a result of at most {MAX_BYTES} bytes as JSON, got {len(data)}")
    return data


@cache
def versions() -> Mapping[str, str]:
    """Returns the installed version of each package that determines the bits of a result."""
    return {package: version(package) for package in ("selfmodel", "mujoco", "numpy", "cma")}


def read_result(path: Path, what: str, remedy: str) -> Mapping[str, Any]:
    """Returns the content of a result file, without versions and digest, which is checked.

    Raises:
        InputError: The file cannot be read, is too large, no valid JSON, or has a wrong digest; the
            message has ``what`` was expected, such as "the definition of a run".
    """
    with _explained(path, what, remedy):
        return verified(parse_json(read_file(path, what, MAX_BYTES)))


def read_as(path: Path, kind: type[Read], what: str, remedy: str) -> Read:
    """Returns the content of a result file as an object of a class; see ``read_result``."""
    return converted(path, renamed(read_result(path, what, remedy)), kind, what, remedy)


def converted(path: Path, values: object, kind: type[Read], what: str, remedy: str) -> Read:
    """Returns JSON values of a file as an object of a class; see ``read_result``."""
    with _explained(path, what, remedy):
        return msgspec.convert(values, kind)


@contextmanager
def _explained(path: Path, what: str, remedy: str) -> Iterator[None]:
    try:
        yield
    except InputError as error:
        raise InputError(f"{error}; {remedy}") from error
    except (ValueError, msgspec.ValidationError) as error:  # no ValueError in msgspec 0.19
        raise InputError(f"{path}: expected {what}: {error}; {remedy}") from error


def parse_json(data: bytes) -> Any:  # noqa: ANN401  # JSON
    """Returns the values of a JSON document in UTF-8, with finite numbers and bounded nesting."""
    try:
        return json.loads(data.decode(), parse_float=_finite, parse_constant=_finite)
    except RecursionError:
        raise ValueError("its values are nested too deeply") from None


def verified(values: Any) -> Mapping[str, Any]:  # noqa: ANN401  # JSON
    """Returns the content of a parsed result file, after its digest was checked."""
    if not isinstance(values, dict):
        raise ValueError("it is no JSON object")  # noqa: TRY004  # one error for all damage
    if not values.keys() & {MADE_WITH, DIGEST}:
        return values
    content = {key: value for key, value in values.items() if key != DIGEST}
    if values.get(DIGEST) != digest_of(content):
        raise ValueError("its digest is missing or wrong, so it was altered or damaged")
    if not isinstance(content.pop(MADE_WITH, None), dict):
        raise ValueError("it lacks the versions that made it")  # noqa: TRY004  # as above
    return content


def digest_of(values: object) -> str:
    """Returns the SHA-256 of JSON values in a canonical form."""
    try:
        text = json.dumps(values, sort_keys=True, separators=(",", ":"), allow_nan=False)
    except RecursionError:
        raise ValueError("its values are nested too deeply") from None
    return hashlib.sha256(text.encode()).hexdigest()


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"it contains the number {text[:40]}, which is not finite")
    return number


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
    with _explained(path, what, "move it away, and the report is made without it"):
        values = parse_json(read_file(path, what, MAX_BYTES))
        return msgspec.convert(values, tuple[Search, ...])


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
    with _explained(path, what, "name the hypothesis by --hypothesis"):
        values = parse_json(read_file(path, what, MAX_BYTES))
        last = values[-1] if isinstance(values, list) and values else verified(values)
        ranked = last.get("diagnosis", last.get("ranked")) if isinstance(last, dict) else None
        return msgspec.convert(ranked, _Ranking)[0].hypothesis


class _Candidate(Struct):
    hypothesis: str


_Ranking = Annotated[list[_Candidate], Meta(min_length=1)]
