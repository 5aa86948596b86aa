"""Tables of the statistics of a study: marginal means and paired comparisons, each with n."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, get_args, get_type_hints

from selfmodel.experiments.comparison.table_formats import Table
from selfmodel.experiments.confidence_intervals import Interval
from selfmodel.experiments.statistics import Comparison, MarginalMean
from selfmodel.experiments.statistics.comparison import LEVEL
from selfmodel.experiments.study.files import as_dicts

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

MEANS = ("table", "method", "n", "seeds", "cells", "mean (95 %)")
PAIRS = ("table", "first", "second", "n", "seeds", "difference (95 %)", "only first", "only second")
P_VALUES = ("p, runs", "p, runs, Holm", "p, seeds", "p, Holm", "better")
"""Titles of the columns for readers."""

MEAN_NAMES = (
    *("table", "method", "n", "seeds", "cells", "left_out"),
    *("mean", "mean_low", "mean_high"),
)
PAIR_NAMES = (
    *("table", "first", "second", "n", "seeds", "first_mean", "second_mean"),
    *("difference", "difference_low", "difference_high", "only_first", "only_second"),
    *("p_runs", "p_runs_holm", "p_seeds", "p_holm", "better"),
)
"""Names of the columns for programs."""


def table_of_rows(rows: Sequence[object]) -> Table:
    """Returns the rows of a study as a table.

    Args:
        rows: Records of one class; at least one.
    """
    records = as_dicts(rows)  # type: ignore[arg-type]  # dataclasses
    texts = [["-" if value is None else str(value) for value in one.values()] for one in records]
    names = list(records[0])
    return Table("rows", names, records, names, texts, len(names), _kinds(rows[0]))


def table_of_records(
    name: str,
    records: "Sequence[DataclassInstance]",
    columns: Sequence[str],
    rows: Sequence[Sequence[str]],
    texts: int,
) -> Table:
    """Returns records of one class as a table; an interval has three columns, as ``share_low``.

    Args:
        name: Name of its file, without an extension.
        records: The records.
        columns: Titles of the columns for readers.
        rows: Rows for readers, a text per column.
        texts: Number of leading columns that are texts.
    """
    values = [_record(record) for record in records]
    names, kinds = (tuple(values[0]), _kinds(records[0])) if values else ((), {})
    return Table(name, names, values, columns, rows, texts, kinds)


def _kinds(record: object) -> dict[str, type]:
    """Returns the type of each attribute of a record that is a number, a text or a flag."""
    hints = get_type_hints(type(record)).items()
    first = {name: (get_args(hint) or (hint,))[0] for name, hint in hints}
    return {name: kind for name, kind in first.items() if kind in (bool, int, float, str)}


def _record(record: "DataclassInstance") -> dict[str, Any]:
    """Returns the values of a record by the name of their column; None for an unknown number."""
    found: dict[str, Any] = {}
    for name, kind in get_type_hints(type(record)).items():
        value = getattr(record, name)
        if Interval in (kind, *get_args(kind)):
            found |= _ends(name, value or Interval(math.nan, math.nan, math.nan))
        else:
            found[name] = None if isinstance(value, float) and math.isnan(value) else value
    return found


def table_of_means(means: Sequence[MarginalMean]) -> Table:
    """Returns marginal means as a table."""
    return Table(
        name="marginal-means",
        names=MEAN_NAMES,
        records=[
            {
                "table": ", ".join(one.table),
                "method": one.method,
                "n": one.runs,
                "seeds": one.seeds,
                "cells": one.cells,
                "left_out": one.left_out,
                **_ends("mean", one.mean),
            }
            for one in means
        ],
        columns=MEANS,
        rows=[
            [
                ", ".join(one.table),
                one.method,
                *map(str, (one.runs, one.seeds, one.cells)),
                interval_text(one.mean),
            ]
            for one in means
        ],
        texts=2,
    )


def table_of_comparisons(comparisons: Sequence[Comparison]) -> Table:
    """Returns paired comparisons as a table."""
    return Table(
        name="comparisons",
        names=PAIR_NAMES,
        records=[
            {
                "table": ", ".join(one.table),
                "first": one.first,
                "second": one.second,
                "n": one.runs,
                "seeds": one.seeds,
                "first_mean": one.first_mean,
                "second_mean": one.second_mean,
                **_ends("difference", one.difference),
                "only_first": one.only_first,
                "only_second": one.only_second,
                "p_runs": one.p_runs,
                "p_runs_holm": one.p_runs_holm,
                "p_seeds": one.p_seeds,
                "p_holm": one.p_holm,
                "better": one.better,
            }
            for one in comparisons
        ],
        kinds={"better": str},
        columns=PAIRS + P_VALUES,
        rows=[
            [
                ", ".join(one.table),
                one.first,
                one.second,
                *map(str, (one.runs, one.seeds)),
                interval_text(one.difference),
                *map(str, (one.only_first, one.only_second)),
                *map(p_text, (one.p_runs, one.p_runs_holm, one.p_seeds, one.p_holm)),
                one.better or "-",
            ]
            for one in comparisons
        ],
        texts=3,
    )


def interval_text(interval: Interval) -> str:
    """Returns an estimate with the ends of its interval as text: 0.257 (0.036 to 0.413)."""
    if math.isnan(interval.low):
        return f"{interval.estimate:.3f} (-)"
    return f"{interval.estimate:.3f} ({interval.low:.3f} to {interval.high:.3f})"


def p_text(p: float) -> str:
    """Returns a p value as text; very small ones as a bound.

    It has two digits, or as many as are necessary to distinguish it from the level: 0.0496 is not
    0.05.
    """
    if p < 0.0001:
        return "< 0.0001"
    texts = (f"{p:.{digits}g}" for digits in range(2, 18))
    return next(text for text in texts if (float(text) < LEVEL) == (p < LEVEL))


def _ends(name: str, interval: Interval) -> dict[str, float | None]:
    values = {
        name: interval.estimate,
        f"{name}_low": interval.low,
        f"{name}_high": interval.high,
    }
    return {key: None if math.isnan(value) else value for key, value in values.items()}
