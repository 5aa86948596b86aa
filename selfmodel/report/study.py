"""Sections of the report of a study: paired comparisons, rates by method, and recoveries."""

import math
from collections.abc import Mapping, Sequence
from statistics import median

import pandas as pd

from selfmodel.errors import counted, joined
from selfmodel.report.charts import BarChart, Cell, Estimate, Group, IntervalChart, Section, Table
from selfmodel.studies.comparisons import p_text
from selfmodel.studies.recoveries import ENDS, RULE
from selfmodel.studies.rows import LoadedStudy, label_of, methods_of, outcomes_text, whole
from selfmodel.studies.statistics import proportion
from selfmodel.studies.study import Row, grouped

CORRECT = "correct"
"""Column of the rows of a study: whether a diagnosis is right."""

MINUS = "\N{MINUS SIGN}"

P = (
    "A difference is of the n runs that both methods have, with its 95 % interval over seeds; p is "
    "the larger of a test over runs and one over seeds, corrected for all pairs of its "
    "methods. A filled point is decided, by a p below 0.05; fewer than four seeds decide nothing."
)


def compared(study: LoadedStudy) -> tuple[str, tuple[str, ...], list[Section]]:
    """Returns headline, further sentences and sections of a study that compares methods."""
    pairs, means = whole(study.comparisons()), whole(study.marginal_means())
    decided, methods = int(pairs["better"].notna().sum()), means["method"].nunique()
    headline = (
        f"{counted(methods, 'method')} in {counted(len(study.rows), 'row')}: {decided} of "
        f"{counted(len(pairs), 'paired comparison')} {'is' if decided == 1 else 'are'} decided."
    )
    best = [_best(table, own, pairs) for table, own in means.groupby("table", sort=False)]
    near = _nearest(pairs, study)
    items: list[IntervalChart | Table] = []
    items += [_differences(*one) for one in pairs[near].groupby("table", sort=False)]
    if not near.all():
        records = pairs.assign(table=pairs["table"].map(", ".join)).to_dict("records")
        title = "All pairs; a chart has those that differ in comparator or search alone"
        items.append(Table.of(title, records))
    text = (P, *(f"Warning: {one}." for one in study.warnings()))
    sections = [
        Section("comparisons", "Paired comparisons", text, tuple(items)),
        Section(
            "methods",
            "Methods",
            ("Means over the cells that all methods have, with 95 % intervals.",),
            tuple(_means(name, own, study) for name, own in means.groupby("table", sort=False)),
        ),
    ]
    return headline, tuple(best), sections


def _nearest(pairs: pd.DataFrame, study: LoadedStudy) -> pd.Series:
    """Returns whether pairs differ in comparator or search alone; all, where none does."""
    rows = study.rows.to_dict("records")
    parts = {
        name: {str(row.get("comparator")), str(row.get("diagnostic_search"))}
        for name, row in zip(methods_in(rows), rows, strict=True)
    }
    near = [bool(parts[row.first] & parts[row.second]) for row in pairs.itertuples()]
    return pd.Series(near if any(near) else True, index=pairs.index)


def _best(table: tuple[str, ...], means: pd.DataFrame, pairs: pd.DataFrame) -> str:
    first = means.sort_values("mean", ascending=False, kind="stable").iloc[0]
    equal = means["method"][means["mean"] == first["mean"]]
    if len(equal) > 1:
        return f"{', '.join(table)}: {joined([*equal])} have the largest mean, {first['mean']:.3g}."
    better = int(((pairs["table"] == table) & (pairs["better"] == first["method"])).sum())
    return (
        f"{', '.join(table)}: {first['method']} has the largest mean, {first['mean']:.3g}, and is "
        f"better than {better} of {counted(len(means) - 1, 'other')}."
    )


def _differences(table: tuple[str, ...], pairs: pd.DataFrame) -> IntervalChart:
    estimates = tuple(
        Estimate(
            f"{row.first} {MINUS} {row.second} (n = {row.n}, p {p_text(row.p_holm)})",
            *(row.difference, row.difference_low, row.difference_high),
            note="" if row.better else "not decided",
        )
        for row in pairs.sort_values("difference", ascending=False, kind="stable").itertuples()
    )
    title = f"{', '.join(table)}: first minus second"
    return IntervalChart(title, "mean paired difference", estimates, reference=0.0)


def _means(table: tuple[str, ...], means: pd.DataFrame, study: LoadedStudy) -> IntervalChart:
    measure = study.outcomes.loc[study.outcomes["table"] == table, "measure"].iloc[0]
    estimates = tuple(
        Estimate(f"{row.method} (n = {row.n})", row.mean, row.mean_low, row.mean_high)
        for row in means.itertuples()
    )
    share = measure == "share"
    label, limits = ("share of right diagnoses", (0.0, 1.0)) if share else ("mean", None)
    title = f"{', '.join(table)}: mean of each method"
    return IntervalChart(title, label, estimates, limits=limits)


def shares(rows: Sequence[Mapping[str, Cell]], *, by_method: bool) -> Section | None:
    """Returns the right diagnoses of each method, never pooled: by case, and by gap.

    The rows have a judged diagnosis. They may be charted by method alone too, where no comparison
    is.
    """
    named = [{**row, "method": name} for row, name in zip(rows, methods_in(rows), strict=True)]
    names = ("robot", "trials", "method")
    split = [name for name in names if len({row.get(name) for row in named}) > 1] or ["method"]
    found = grouped(named, *split).items()
    groups = dict(sorted(found, key=lambda one: [_numbers_first(str(value)) for value in one[0]]))
    items: list[IntervalChart | Table] = []
    if by_method and len(groups) > 1:
        points = tuple(_share(", ".join(map(str, key)), own) for key, own in groups.items())
        title = f"Share of right diagnoses by {' and '.join(split)}, with 95 % intervals"
        items.append(IntervalChart(title, "share of right diagnoses", points, limits=(0.0, 1.0)))
    for factor in ("case", "gap"):
        values = sorted({_value(row, factor) for row in named}, key=_numbers_first)
        if len(values) > 1:
            records = [
                {
                    **dict(zip(split, key, strict=True)),
                    **{
                        value: _count([row for row in own if _value(row, factor) == value])
                        for value in values
                    },
                }
                for key, own in groups.items()
            ]
            items.append(Table.of(f"Right diagnoses by {factor}", records))
    text = "Right of all diagnoses; methods are apart. A column of a table is a case or a gap."
    return Section("shares", "Right diagnoses", (text,), tuple(items)) if items else None


def methods_in(rows: Sequence[Mapping[str, Cell]]) -> list[str]:
    """Returns the method of each row; of a table without one, all rows are of one method."""
    if all("comparator" in row for row in rows):
        return methods_of([{**row, "comparator": str(row["comparator"])} for row in rows])
    return [str(row.get("method", "all")) for row in rows]


def _value(row: Mapping[str, Cell], factor: str) -> str:
    """Returns a case or a gap as text; a failure that is no case has its notation."""
    value = row.get(factor)
    return str(row.get("truth", "") if value is None and factor == "case" else value)


def _count(rows: Sequence[Mapping[str, Cell]]) -> str | None:
    return f"{sum(bool(row[CORRECT]) for row in rows)}/{len(rows)}" if rows else None


def _share(name: str, rows: Sequence[Mapping[str, Cell]]) -> Estimate:
    share = proportion(sum(bool(row[CORRECT]) for row in rows), len(rows))
    return Estimate(f"{name} (n = {len(rows)})", share.estimate, share.low, share.high)


def _numbers_first(name: str) -> tuple[float, str]:
    """Sort key of names, of which some are numbers."""
    try:
        value = float(name)
    except ValueError:
        return math.inf, name
    return (math.inf if math.isnan(value) else value), name


def recoveries(rows: Sequence[Row]) -> tuple[str, list[Section]]:
    """Returns headline and sections of a study of bodies: what they did after a failure."""
    runs = [row for row in rows if None not in (row["before"], row["best_trial"])]
    robots = counted(len({row["robot"] for row in runs}), "robot")
    headline = _with_outcomes(f"{counted(len(runs), 'run')} of {robots} with a failure", runs)
    scores = grouped([{"score": None, "unit": None, **row} for row in runs], "score", "unit")
    charts = tuple(
        BarChart(
            title="Before the failure, after it, and in the best trial since",
            x_label=label_of(same),
            names=tuple(end.replace("_", " ") for end in ENDS),
            groups=tuple(_body(*key, own) for key, own in _failures(same).items()),
        )
        for same in scores.values()
    )
    text = "Medians over the seeds of a body and a failure. A hatched bar has a trial that fell."
    reasons = dict.fromkeys(
        f"{row['robot']}: {row['reason']}." for row in rows if row.get("reason")
    )
    section = Section("recoveries", "Recoveries", (f"{text} {RULE}", *reasons), charts)
    return f"{headline}.", [section] if charts else []


def _failures(rows: Sequence[Row]) -> dict[tuple[str, str], list[Row]]:
    named = [
        {**row, "failure": row["truth"] if row["case"] is None else f"case {row['case']}"}
        for row in rows
    ]
    return grouped(named, "robot", "failure")


def _body(robot: str, failure: str, rows: Sequence[Row]) -> Group:
    falls = [sum(row.get(f"upright_{end}") is False for row in rows) for end in ENDS]
    notes = tuple(f"fell in {number} of {len(rows)}" if number else "" for number in falls)
    values = tuple(float(median(row[name] for row in rows)) for name in ENDS)
    return Group(_with_outcomes(f"{robot}, {failure}", rows), values, notes)


def _with_outcomes(text: str, rows: Sequence[Row]) -> str:
    return ": ".join(filter(None, (text, outcomes_text(rows))))
