"""The ``result.json`` of a run, as far as a report needs it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any, TypeVar

from selfmodel.diagnosis.sentences import right_or_wrong
from selfmodel.errors import InputError
from selfmodel.logs.result_files import read_result

RESULT = "result.json"

REMEDY = "move it away, and the report is made of the logs and diagnoses"

Value = TypeVar("Value")


@dataclass(frozen=True)
class RunScore:
    """The score of a recovery.

    Attributes:
        name: Name of the score.
        unit: Unit; "" without one.
        before: Score before the failure.
        after: Score of the same controller after the failure.
        recovered: Largest score of the trials since.
    """

    name: str
    unit: str
    before: float
    after: float
    recovered: float


@dataclass(frozen=True)
class TrialResult:
    """Result of a trial.

    Attributes:
        score: Score of the trial; None if unknown.
        predicted: Score that was predicted before the trial; None if none was.
        hypothesis: Best hypothesis at the time, in notation.
        fell_at_step: Step at which the robot fell; None if it did not.
    """

    score: float | None
    predicted: float | None
    hypothesis: str
    fell_at_step: int | None


@dataclass(frozen=True)
class RunResult:
    """Result of a recovery of a simulated robot.

    Attributes:
        comparator: Name of the comparator.
        kinds: Names of the fault kinds that were searched.
        calibration: JSON values of the calibration; None without one.
        truth: True faults, in notation.
        gap: Level of the reality gap.
        judgement: Judgement of the diagnosis, such as ``right``.
        score: The score.
        fell: Whether the robot fell in its best trial.
        physical_trials: Number of trials since the failure.
        trials: Result of each trial, by the name of its log.
    """

    comparator: str
    kinds: tuple[str, ...]
    calibration: Mapping[str, Any] | None
    truth: str
    gap: float
    judgement: str
    score: RunScore
    fell: bool
    physical_trials: int
    trials: Mapping[str, TrialResult]


def read_run_result(folder: Path) -> RunResult | None:
    """Returns the result of a run; None if it has none, as a run that goes on.

    Raises:
        InputError: The file is damaged, or of a version that did not record all of this.
    """
    path = folder / RESULT
    if not path.exists():
        return None
    values = read_result(path, "the result of a recovery", REMEDY).content
    return parsed(path, lambda: _result(values))


def parsed(
    path: Path,
    parse: Callable[[], Value],
    what: str = "the result of a recovery",
    remedy: str = REMEDY,
) -> Value:
    """Returns what a function makes of a result's values.

    Args:
        path: The file, for the error.
        parse: The function.
        what: Expected content, for the error.
        remedy: Remedy, for the error.

    Raises:
        InputError: A value is missing, or of another type.
    """
    try:
        return parse()
    except InputError:
        raise
    except (LookupError, TypeError, ValueError, AttributeError, OverflowError) as error:
        cause = f"{type(error).__name__}: {error}"
        raise InputError(f"{path}: expected {what}: {cause}; {remedy}") from error


def _result(values: Mapping[str, Any]) -> RunResult:
    score = values["score"]
    return RunResult(
        comparator=str(values["comparator"]),
        kinds=tuple(str(kind) for kind in values["kinds"]),
        calibration=values["calibration"],
        truth=str(values["truth"]),
        gap=float(values["gap"]),
        judgement=right_or_wrong(values),
        score=RunScore(
            str(score["name"]),
            str(score["unit"]),
            *(_number(score[when]) for when in ("before", "after", "recovered")),
        ),
        fell=bool(values["fell"]),
        physical_trials=int(values["physical_trials"]),
        trials={
            PurePath(str(row["log"]).replace("\\", "/")).stem: TrialResult(
                score=None if row["score"] is None else float(row["score"]),
                predicted=None if row["predicted_score"] is None else float(row["predicted_score"]),
                hypothesis=str(row["hypothesis"]),
                fell_at_step=None if row["fell_at_step"] is None else int(row["fell_at_step"]),
            )
            for row in values["trials"]
        },
    )


def _number(value: float | None) -> float:
    """Returns a number; NaN, which JSON lacks, for None."""
    return float("nan") if value is None else float(value)
