"""Marginal means: means of cell means, so that methods with other numbers of runs compare."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy import stats

from selfmodel.arrays import FloatArray
from selfmodel.experiments.confidence_intervals import Interval
from selfmodel.experiments.statistics.outcome import (
    Cell,
    Outcome,
    by_method,
    by_table,
    measure_of,
)
from selfmodel.experiments.statistics.paired_interval import NORMAL, TAIL


@dataclass(frozen=True)
class MarginalMean:
    """Mean of a method over the cells that all methods of its table have, equally weighted.

    Attributes:
        table: Names of the table.
        method: Name of the method.
        runs: Number of runs of the method in these cells.
        seeds: Number of their seeds.
        cells: Number of cells.
        left_out: Number of runs of the method in cells that another method lacks.
        mean: Mean of the cell means, with a 95 % interval.
    """

    table: Cell
    method: str
    runs: int
    seeds: int
    cells: int
    left_out: int
    mean: Interval


def marginal_means(outcomes: Iterable[Outcome]) -> tuple[MarginalMean, ...]:
    """Returns the marginal mean of each method of each table.

    Of shares, the interval contains Wilson's, for the effective number of independent runs.
    All intervals contain Student's over the means of the seeds, unless a seed lacks a cell.

    Assumptions: the cells are fixed and equally important; a cell mean does not depend on which
    seeds a method has. Paired differences need neither, and are preferable.

    Source: S. R. Searle, F. M. Speed and G. A. Milliken, *Population Marginal Means in the Linear
    Model*, The American Statistician 34 (1980).
    """
    found = []
    for table, own in by_table(outcomes).items():
        methods = by_method(own)
        common = set.intersection(*({cell for cell, _ in runs} for runs in methods.values()))
        interval = _of_proportions if measure_of(own) == "share" else _of_numbers
        found += [
            _marginal(table, method, runs, common, interval) for method, runs in methods.items()
        ]
    return tuple(found)


def _marginal(
    table: Cell,
    method: str,
    runs: Mapping[tuple[Cell, int], float],
    common: set[Cell],
    interval: Callable[[FloatArray], Interval],
) -> MarginalMean:
    cells = sorted(common)
    seeds = sorted({seed for cell, seed in runs if cell in common})
    values = np.array([[runs.get((cell, seed), math.nan) for cell in cells] for seed in seeds])
    return MarginalMean(
        table=table,
        method=method,
        runs=int(np.isfinite(values).sum()),
        seeds=len(seeds),
        cells=len(cells),
        left_out=sum(cell not in common for cell, _ in runs),
        mean=interval(values) if values.size else Interval(math.nan, math.nan, math.nan),
    )


def _of_numbers(values: FloatArray) -> Interval:
    """Returns the mean of cell means with Student's interval over seeds.

    Args:
        values: ``(seeds, cells)``; NaN for a run that is missing. If there is one, or a single
            seed, the interval is NaN.
    """
    mean = float(np.nanmean(values, axis=0).mean())
    if len(values) < 2 or np.isnan(values).any():
        return Interval(mean, math.nan, math.nan)
    deviation = float(values.mean(axis=1).std(ddof=1))
    half = float(stats.t.ppf(TAIL, len(values) - 1)) * deviation / math.sqrt(len(values))
    return Interval(mean, mean - half, mean + half)


def _of_proportions(values: FloatArray) -> Interval:
    """Returns the mean of cell proportions with an interval that contains Wilson's and Student's.

    Args:
        values: ``(seeds, cells)``; NaN for a run that is missing.
    """
    over_seeds = _of_numbers(values)
    # The variance of a mean of cell means is that of this many runs in one cell.
    runs = values.shape[1] ** 2 / float((1 / np.isfinite(values).sum(axis=0)).sum())
    low, high = _wilson(over_seeds.estimate, runs)
    low, high = np.fmin(low, over_seeds.low), np.fmax(high, over_seeds.high)
    return Interval(over_seeds.estimate, max(0.0, float(low)), min(1.0, float(high)))


def _wilson(share: float, runs: float) -> tuple[float, float]:
    """Returns the ends of Wilson's score interval; the number of runs may be a fraction."""
    middle = (share + NORMAL**2 / (2 * runs)) / (1 + NORMAL**2 / runs)
    root = math.sqrt(share * (1 - share) / runs + (NORMAL / (2 * runs)) ** 2)
    half = NORMAL * root / (1 + NORMAL**2 / runs)
    return middle - half, middle + half
