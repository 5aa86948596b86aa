"""Results of a study of baselines: a row per cell and method, and their summaries."""

import dataclasses
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import mean, median
from typing import Any, get_args, get_type_hints

from selfmodel.errors import InputError
from selfmodel.experiments.grid import FinishedPart, finished
from selfmodel.experiments.study.files import write_files
from selfmodel.recovery.baselines.registry import ORACLE

AFTER = (1, 3, 20)
"""Numbers of physical trials after which methods are compared."""


@dataclass(frozen=True)
class BaselineRow:
    """One method on one damaged physical robot, with its cost.

    Attributes:
        method: Name of the baseline.
        robot: Name of the robot.
        case: Number of the failure in Table I.
        truth: The failure, in notation.
        gap: Level of the reality gap.
        seed: Seed of the physical robot and of all random choices.
        best: Best displacement up to a fall so far, after each physical trial, m.
        upright: Displacement up to the first fall of each trial, m.
        displacement: Displacement of each trial, m.
        fallen: Whether the robot fell, per trial.
        steps: Control steps that each trial lasted.
        simulated_steps: Control steps simulated, apart from the repertoire's.
        seconds: Wall time on one thread, s.
    """

    method: str
    robot: str
    case: int
    truth: str
    gap: float
    seed: int
    best: list[float]
    upright: list[float]
    displacement: list[float]
    fallen: list[bool]
    steps: list[int]
    simulated_steps: int
    seconds: float

    def value(self, trials: int) -> float:
        """Returns the best displacement up to a fall after a number of trials, m.

        The value of the oracle is the mean of all its trials.
        """
        if self.method == ORACLE:
            return mean(self.upright)
        return self.best[min(trials, len(self.best)) - 1]


@dataclass(frozen=True)
class BaselineSummary:
    """Medians of a method over the seeds of a robot, a case and a gap.

    Attributes:
        method: Name of the baseline.
        robot: Name of the robot.
        case: Number of the failure.
        gap: Level of the reality gap.
        runs: Number of seeds.
        values: Value after each number of trials in ``AFTER``, m.
        ratios: Value divided by the oracle's on the same physical robot, after each number of
            trials in ``AFTER``; None without an oracle above 0.
        trials: Number of physical trials.
        simulated_steps: Control steps simulated.
        seconds: Wall time on one thread, s.
    """

    method: str
    robot: str
    case: int
    gap: float
    runs: int
    values: list[float]
    ratios: list[float] | None
    trials: float
    simulated_steps: float
    seconds: float


@dataclass(frozen=True)
class BaselineResults:
    """Results of a study and their files.

    Attributes:
        rows: Rows of all finished parts.
        summaries: Summaries of the rows.
        files: Paths of the files.
    """

    rows: tuple[BaselineRow, ...]
    summaries: tuple[BaselineSummary, ...]
    files: tuple[Path, ...]

    def as_dict(self) -> dict[str, Any]:
        """Returns rows and summaries as JSON."""
        return {
            "rows": [dataclasses.asdict(row) for row in self.rows],
            "summaries": [dataclasses.asdict(one) for one in self.summaries],
        }


def collect(folder: Path) -> tuple[BaselineRow, ...]:
    """Returns the rows of all finished parts in the folder of a study, in order.

    Raises:
        InputError: A file in the folder is damaged.
    """
    found = [_row(part) for part in finished(folder / "runs")]
    return tuple(
        sorted(found, key=lambda row: (row.robot, row.case, row.gap, row.seed, row.method))
    )


def write_results(folder: Path) -> BaselineResults:
    """Writes ``results.jsonl``, one line per cell and method, from the finished parts of a study.

    Raises:
        InputError: A file in the folder is damaged.
        OSError: The results cannot be written.
    """
    rows = collect(folder)
    lines = [json.dumps(dataclasses.asdict(row), allow_nan=False) + "\n" for row in rows]
    files = write_files(folder, {"results.jsonl": "".join(lines).encode()})
    return BaselineResults(rows, summarise(rows), files)


def summarise(rows: Sequence[BaselineRow]) -> tuple[BaselineSummary, ...]:
    """Returns the summaries of rows, by robot, case, gap and method."""
    oracles = {
        (row.robot, row.case, row.gap, row.seed): row.value(1)
        for row in rows
        if row.method == ORACLE
    }
    groups: dict[tuple[str, int, float, str], list[BaselineRow]] = {}
    for row in rows:
        groups.setdefault((row.robot, row.case, row.gap, row.method), []).append(row)
    return tuple(_summary(own, oracles) for own in groups.values())


def _summary(
    rows: list[BaselineRow], oracles: dict[tuple[str, int, float, int], float]
) -> BaselineSummary:
    first = rows[0]
    bounds = [oracles.get((row.robot, row.case, row.gap, row.seed), 0.0) for row in rows]
    pairs = [(row, bound) for row, bound in zip(rows, bounds, strict=True) if bound > 0]
    return BaselineSummary(
        method=first.method,
        robot=first.robot,
        case=first.case,
        gap=first.gap,
        runs=len(rows),
        values=[median(row.value(trials) for row in rows) for trials in AFTER],
        ratios=[median(row.value(trials) / bound for row, bound in pairs) for trials in AFTER]
        if pairs
        else None,
        trials=median(len(row.best) for row in rows),
        simulated_steps=median(row.simulated_steps for row in rows),
        seconds=median(row.seconds for row in rows),
    )


def _row(part: FinishedPart) -> BaselineRow:
    try:
        return row_of(part.result)
    except InputError as error:
        raise InputError(
            f"{part.path}: {error}; delete the file, and the same command computes its cell again"
        ) from error


def row_of(values: Any) -> BaselineRow:  # noqa: ANN401  # JSON
    """Returns the row in an object of JSON.

    Raises:
        InputError: It has other keys, a value of another type, a number that is not finite, or no
            trial.
    """
    types = get_type_hints(BaselineRow)
    if not isinstance(values, dict) or values.keys() != types.keys():
        got = ", ".join(values)[:300] if isinstance(values, dict) else json.dumps(values)[:80]
        raise InputError(
            f"expected the row of a baseline with the keys {', '.join(sorted(types))}, got {got}"
        )
    for name, value in values.items():
        inner = get_args(types[name])
        kind, items = (inner[0], value) if inner else (types[name], [value])
        if not isinstance(items, list) or not items or not all(_is_a(kind, one) for one in items):
            what = f"numbers or flags per trial ({kind.__name__})" if inner else kind.__name__
            raise InputError(f"expected {name} as {what}, got {json.dumps(value)[:80]}")
    return BaselineRow(**values)


def _is_a(kind: type, value: object) -> bool:
    if kind is float:
        return type(value) in (float, int) and math.isfinite(value)  # type: ignore[arg-type]
    return type(value) is kind
