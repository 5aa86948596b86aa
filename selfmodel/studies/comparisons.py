"""Paired comparisons of the methods of a study, and their marginal means, by frames of outcomes."""

import itertools
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from selfmodel.arrays import FloatArray
from selfmodel.errors import InputError
from selfmodel.studies import statistics
from selfmodel.studies.statistics import NORMAL, TAIL, UNKNOWN, Interval

LEVEL = 0.05
"""Largest probability of any false "better" in a table."""

OUTCOME = ("table", "method", "cell", "seed", "value", "measure")
"""Columns of a frame of outcomes, the values that one method reached in one run each. Those with
the same ``table``, ``cell`` and ``seed`` are of the same physical robot and the same trials, so
methods are compared by pairs.

``table``: names of what is compared apart from other outcomes, such as robot and number of trials,
a tuple. ``cell``: names of the fixed conditions of the run, a tuple: gap and failure. ``seed``:
seed of the run; runs of one seed share gaits and parameters of the physical robot. ``value``: 1 or
0 for right or wrong, or a finite number in the unit of the table. ``measure``: ``share`` for right
and wrong, ``number`` for other values; one in a table.
"""


def compare(outcomes: pd.DataFrame) -> pd.DataFrame:
    """Returns the paired comparisons of all methods of each table, a row each.

    Two methods differ if a test over runs and a test over seeds both reject equality: the first is
    wrong where runs of one seed depend on each other, the second where the means of few runs are
    equal by chance. The larger p is corrected for the number of pairs of its table by Holm's
    method; several tables are not corrected for each other.

    Args:
        outcomes: Outcomes of all methods, with the columns ``OUTCOME``.

    Returns:
        ``table``; ``first``, the method with the larger mean, and ``second``; ``n``, the number of
        runs that both have, and ``seeds``; ``first_mean``, ``second_mean``; ``difference``, its
        mean over these runs, with the ends of its interval over seeds, ``difference_low`` and
        ``difference_high``; ``only_first`` and ``only_second``, the numbers of runs in which one is
        larger; ``p_runs``, of the exact McNemar test for a share, of the sign-flip test for
        numbers, and ``p_runs_holm``; ``p_seeds``, of ``statistics.seed_test``; ``p_holm``, the
        larger of both, corrected; ``better``, the first method if that is below ``LEVEL``, else
        None.

    Raises:
        InputError: A value is not finite, or no 0 or 1 in a share; a method has two outcomes of one
            run; or a table has two measures.
    """
    rows: list[dict[str, Any]] = []
    for table, measure, runs in _tables(outcomes):
        pairs: list[dict[str, Any]] = []
        for methods in itertools.combinations(runs.columns, 2):
            both = runs[list(methods)].dropna().astype(float)
            if len(both):
                pairs.append({"table": table, **_compared(both, measure)})
        over_runs = statistics.holm([pair["p_runs"] for pair in pairs])
        over_both = statistics.holm([max(pair["p_runs"], pair["p_seeds"]) for pair in pairs])
        for pair, p_runs, p in zip(pairs, over_runs, over_both, strict=True):
            pair |= {"p_runs_holm": p_runs, "p_seeds": pair.pop("p_seeds"), "p_holm": p}
            pair["better"] = pair["first"] if p < LEVEL else None
        rows += pairs
    frame = pd.DataFrame(rows)
    if rows:  # pandas' texts have no None
        frame["better"] = pd.Series([row["better"] for row in rows], dtype=object)
    return frame


def marginal_means(outcomes: pd.DataFrame) -> pd.DataFrame:
    """Returns the mean of each method over the cells that all methods of its table have.

    The cells have equal weights. Of shares, the interval contains Wilson's, for the effective
    number of independent runs. All intervals contain Student's over the means of the seeds, unless
    a seed lacks a cell. Paired differences assume less, and are preferable.

    Source: S. R. Searle, F. M. Speed and G. A. Milliken, *Population Marginal Means in the Linear
    Model*, The American Statistician 34 (1980).

    Returns:
        ``table``, ``method``; ``n``, the number of its runs in these cells, ``seeds``, ``cells``;
        ``left_out``, the number of its runs in other cells; ``mean``, ``mean_low``, ``mean_high``.

    Raises:
        InputError: As for ``compare``.
    """
    rows = []
    for table, measure, runs in _tables(outcomes):
        cells = runs.notna().groupby(level="cell").any().all(axis=1)
        common = runs[runs.index.get_level_values("cell").map(cells)]
        for method in runs.columns:
            values = common[method].unstack("cell").dropna(how="all").to_numpy(dtype=float)  # noqa: PD010  # a pivot of one column
            rows.append(
                {
                    "table": table,
                    "method": method,
                    "n": int(np.isfinite(values).sum()),
                    "seeds": len(values),
                    "cells": int(cells.sum()),
                    "left_out": int(runs[method].notna().sum() - common[method].notna().sum()),
                    **ends("mean", _marginal(values, measure) if values.size else UNKNOWN),
                }
            )
    return pd.DataFrame(rows)


def balance_warnings(outcomes: pd.DataFrame) -> tuple[str, ...]:
    """Returns a sentence for the tables whose methods have different runs, or uneven cells."""
    tables: dict[str, list[str]] = {}
    for table, _, runs in _tables(outcomes):
        counts = runs.notna().groupby(level="cell").sum()
        if runs.isna().any(axis=None) or (counts != counts.iloc[0]).any(axis=None):
            totals = counts.sum()
            numbers = ", ".join(f"{method} {number}" for method, number in totals.items())
            if (totals == totals.iloc[0]).all():
                numbers += ", not the same ones"
            tables.setdefault(numbers, []).append(", ".join(table))
    return tuple(
        f"{'; '.join(names)}: the cells are unbalanced (runs: {numbers}): compare paired "
        f"differences, not means of all runs; marginal means balance the cells, and not the seeds"
        for numbers, names in tables.items()
    )


def p_text(p: float) -> str:
    """Returns a p value as text; very small ones as a bound.

    It has two digits, or as many as are necessary to distinguish it from the level: 0.0496 is not
    0.05.
    """
    if p < 0.0001:
        return "< 0.0001"
    texts = (f"{p:.{digits}g}" for digits in range(2, 18))
    return next(text for text in texts if (float(text) < LEVEL) == (p < LEVEL))


def ends(name: str, interval: Interval) -> dict[str, float]:
    """Returns an interval as the columns of a table: ``NAME``, ``NAME_low``, ``NAME_high``."""
    return {name: interval.estimate, f"{name}_low": interval.low, f"{name}_high": interval.high}


def _tables(outcomes: pd.DataFrame) -> Iterator[tuple[tuple[str, ...], str, pd.DataFrame]]:
    """Yields names, measure and values of each table, in the order of the first outcomes.

    The values have a row per run, by cell and seed, and a column per method; NaN for none.
    """
    for table, rows in outcomes.groupby("table", sort=False):
        measure, *others = rows["measure"].unique()
        if others:
            raise InputError(
                f"expected one measure in the table {', '.join(table)}, got {measure} and "
                f"{' and '.join(others)}: name two tables"
            )
        share = measure == "share"
        allowed = rows["value"].isin([0, 1]) if share else np.isfinite(rows["value"])
        expected = "1 or 0, for right or wrong," if share else "a finite value"
        twice = rows.duplicated(["method", "cell", "seed"])
        for wrong, what in ((~allowed, expected), (twice, "one outcome")):
            if wrong.any():
                row = rows[wrong].iloc[0]
                run = ", ".join((*table, *map(str.strip, row["cell"]), f"seed {row['seed']}"))
                got = "two" if wrong is twice else row["value"]
                raise InputError(
                    f"expected {what} of {row['method']} in {run}, got {got}: compare the rows of "
                    f"one study, each once, without runs that have no value"
                )
        runs = rows.pivot(index=["cell", "seed"], columns="method", values="value")  # noqa: PD010  # not to be aggregated
        yield table, str(measure), runs


def _compared(runs: pd.DataFrame, measure: str) -> dict[str, Any]:
    """Returns the comparison of two methods, the columns, on runs that both have, not corrected."""
    means = {name: float(np.mean(runs[name].to_numpy())) for name in runs}
    first, second = sorted(means, key=lambda name: -means[name])  # stable: by name if equal
    found = (runs[first] - runs[second]).tolist()
    seeds = runs.index.get_level_values("seed").tolist()
    only_first, only_second = sum(one > 0 for one in found), sum(one < 0 for one in found)
    rng = np.random.default_rng(0)  # of the bootstrap and the sign flips, the same for each pair
    if measure == "share":
        interval = statistics.paired_proportion_interval(found, seeds, rng)
        p = statistics.exact_mcnemar(only_first, only_second)
    else:
        interval = statistics.paired_interval(found, seeds, rng)
        p = statistics.sign_flip_test(found, rng)
    return {
        "first": str(first),
        "second": str(second),
        "n": len(found),
        "seeds": len(set(seeds)),
        "first_mean": means[first],
        "second_mean": means[second],
        **ends("difference", interval),
        "only_first": only_first,
        "only_second": only_second,
        "p_runs": p,
        "p_seeds": statistics.seed_test(found, seeds),
    }


def _marginal(values: FloatArray, measure: str) -> Interval:
    """Returns the mean of cell means with its interval, from values ``(seeds, cells)``.

    With a missing run, NaN, or a single seed, the interval over seeds is NaN.
    """
    mean = float(np.nanmean(values, axis=0).mean())
    low = high = math.nan
    if len(values) >= 2 and not np.isnan(values).any():
        deviation = float(values.mean(axis=1).std(ddof=1))
        half = float(stats.t.ppf(TAIL, len(values) - 1)) * deviation / math.sqrt(len(values))
        low, high = mean - half, mean + half
    if measure == "share":
        # The variance of a mean of cell means is that of this many runs in one cell; Wilson's score
        # interval allows a fraction of a run.
        runs = values.shape[1] ** 2 / float((1 / np.isfinite(values).sum(axis=0)).sum())
        middle = (mean + NORMAL**2 / (2 * runs)) / (1 + NORMAL**2 / runs)
        root = math.sqrt(mean * (1 - mean) / runs + (NORMAL / (2 * runs)) ** 2)
        half = NORMAL * root / (1 + NORMAL**2 / runs)
        low = max(0.0, float(np.fmin(middle - half, low)))
        high = min(1.0, float(np.fmax(middle + half, high)))
    return Interval(mean, low, high)
