"""Rows of any study, from its folder or its results file, with their statistics."""

import dataclasses
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from selfmodel.arrays import data_frame
from selfmodel.errors import InputError
from selfmodel.experiments.ablation.results import collect as collect_ablation
from selfmodel.experiments.ablation.rows import AblationRow
from selfmodel.experiments.baseline.results import BaselineRow, collect as collect_baselines, row_of
from selfmodel.experiments.comparison import outcomes
from selfmodel.experiments.grid import FinishedPart, finished
from selfmodel.experiments.paper.results import collect as collect_paper
from selfmodel.experiments.paper.rows import RecoveryRow
from selfmodel.experiments.statistics import (
    Comparison,
    MarginalMean,
    Outcome,
    balance_warnings,
    compare,
    imbalances,
    marginal_means,
)
from selfmodel.experiments.study.files import as_dicts, lines_of_csv, read_text, rows_of_csv
from selfmodel.experiments.suite.results import collect as collect_suite
from selfmodel.experiments.suite.rows import SuiteRow

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Compared = TypeVar("Compared", Outcome, Comparison, MarginalMean)


@dataclass(frozen=True)
class LoadedStudy:
    """Rows of a study with their statistics.

    Attributes:
        kind: Command that made the study: ``ablate``, ``baseline``, ``paper`` or ``suite``.
        path: Folder or file that the rows are from.
        rows: One record per diagnosis or recovery.
        outcomes: What the rows compare; none for a study with one method.
    """

    kind: str
    path: Path
    rows: "tuple[DataclassInstance, ...]"
    outcomes: tuple[Outcome, ...]

    def to_pandas(self) -> Any:  # noqa: ANN401  # pandas is optional
        """Returns the rows as a ``pandas.DataFrame``, with a column per attribute.

        Raises:
            InputError: pandas is not installed.
        """
        return data_frame(as_dicts(self.rows))

    def comparisons(self) -> tuple[Comparison, ...]:
        """Returns the paired comparisons of all methods, corrected within each table."""
        return compare(self.outcomes)

    def marginal_means(self) -> tuple[MarginalMean, ...]:
        """Returns the means of all methods over the cells that they share."""
        return marginal_means(self.outcomes)

    def warnings(self) -> tuple[str, ...]:
        """Returns a sentence per kind of imbalance in the tables over all conditions."""
        return balance_warnings(imbalances(whole(self.outcomes)))


def whole(found: "Sequence[Compared]") -> "list[Compared]":
    """Returns what is of the tables over all conditions: those with the fewest names."""
    fewest = min((len(one.table) for one in found), default=0)
    return [one for one in found if len(one.table) == fewest]


def load(path: str | Path) -> LoadedStudy:
    """Returns the rows of a study and their statistics.

    Example::

        study = selfmodel.experiments.load("runs/ablation")
        study.to_pandas().groupby("comparator")["correct"].mean()

    Args:
        path: Folder of ``selfmodel ablate``, ``baseline``, ``paper`` or ``suite run``, finished or
            not; or its ``results.csv``, or the ``results.jsonl`` of baselines.

    Raises:
        InputError: There is no study, it has no finished run, or a file in it is damaged.
    """
    place = Path(path)
    if place.is_dir():
        kind = _kind_of_folder(place)
        return _loaded(kind, place, KINDS[kind].collect(place))
    if not place.is_file():
        raise InputError(
            f"{place}: expected the folder of a study, its results.csv or its results.jsonl, got "
            f"nothing of that name"
        )
    if place.suffix == ".jsonl":
        return _loaded("baseline", place, _rows_of_lines(place))
    kind = _kind_of(dict.fromkeys(next(lines_of_csv(place), [])), place)
    return _loaded(kind, place, rows_of_csv(KINDS[kind].record, place))


@dataclass(frozen=True)
class Kind:
    """Kind of a study.

    Attributes:
        record: Class of its rows.
        collect: Function of a folder to the rows in it.
        outcomes: Function of the rows to what they compare.
    """

    record: "type[DataclassInstance]"
    collect: Callable[[Path], "Sequence[DataclassInstance]"]
    outcomes: Callable[[Any], tuple[Outcome, ...]]


KINDS: Mapping[str, Kind] = {
    "ablate": Kind(AblationRow, collect_ablation, outcomes.of_ablation),
    "baseline": Kind(BaselineRow, collect_baselines, outcomes.of_baselines),
    "paper": Kind(RecoveryRow, lambda folder: collect_paper(folder).recoveries, outcomes.of_paper),
    # Its bodies are recovered with one comparator, and are no pairs.
    "suite": Kind(SuiteRow, collect_suite, lambda _rows: ()),
}
"""Kinds of studies by their command; the columns of a row determine it."""


def _loaded(kind: str, path: Path, rows: "Sequence[DataclassInstance]") -> LoadedStudy:
    if not rows:
        raise InputError(f"{path}: expected the rows of a study, got none: run the study first")
    return LoadedStudy(kind, path, tuple(rows), KINDS[kind].outcomes(rows))


def _kind_of_folder(folder: Path) -> str:
    for part in finished(folder / "runs"):
        row = _first_row(part)
        if row is not None:
            return _kind_of(row, part.path)
    raise InputError(
        f"{folder}: expected the folder of a study with a finished run, got none in "
        f"{folder / 'runs'}: run the study first"
    )


def _first_row(part: FinishedPart) -> Mapping[str, Any] | None:
    """Returns the first row in the result of a part; None if it has no rows of its study."""
    found = part.result
    if isinstance(found, dict):
        found = found.get("recoveries", [] if "evolution" in found else [found])
    return found[0] if isinstance(found, list) and found and isinstance(found[0], dict) else None


def _kind_of(row: Mapping[str, Any], path: Path) -> str:
    for name, kind in KINDS.items():
        fields = dataclasses.fields(kind.record)
        needed = {field.name for field in fields if field.default is dataclasses.MISSING}
        if needed <= row.keys() <= {field.name for field in fields}:
            return name
    raise InputError(
        f"{path}: expected the rows of a study by {', '.join(KINDS)}, got the columns "
        f"{', '.join(row)[:300]}"
    )


def _rows_of_lines(path: Path) -> list[BaselineRow]:
    """Returns the rows of a study of baselines from its file, one JSON object per line."""
    rows = []
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        try:
            rows.append(row_of(json.loads(line)))
        except InputError as error:
            raise InputError(f"{path}, line {number}: {error}") from error
        except (ValueError, RecursionError) as error:
            raise InputError(f"{path}, line {number}: expected a JSON object: {error}") from error
    return rows
