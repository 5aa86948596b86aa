"""Coverage of the intervals and errors of the tests of paired comparisons, by simulation.

Usage: python -m benchmarks.paired_statistics [--studies N]

Simulated studies have the shape of an ablation: cases that are fixed, seeds that are drawn, and
methods whose success depends on the case and on the seed. Prints the tables of
docs/results/statistics.md.
"""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy import stats

from selfmodel.arrays import FloatArray
from selfmodel.studies.comparisons import OUTCOME, compare, marginal_means
from selfmodel.studies.statistics import (
    Interval,
    holm,
    paired_interval,
    paired_proportion_interval,
)

SHARED = 0.3
"""Share of the variance of one run, apart from its seed's, that two methods have in common."""

UNEQUAL = (0.95, 0.9, 0.8, 0.7, 0.6, 0.5, 0.5, 0.4, 0.3)
"""Proportions of a comparator of whole trials by case, at a gap."""

CASES = len(UNEQUAL)
DEPENDENCES = (0.0, 0.15, 0.4)
"""Shares of the variance of a run that are its seed's."""

METHODS = 7


@dataclass(frozen=True)
class Pair:
    """Two methods with the probability that each is right, by case."""

    name: str
    first: FloatArray
    second: FloatArray

    @property
    def difference(self) -> float:
        """True difference of the proportions over these cases."""
        return float(np.mean(self.first - self.second))


PAIRS = (
    Pair("0.99 and 0.30 to 0.95", np.full(CASES, 0.99), np.array(UNEQUAL)),
    Pair("0.99 and 0.95", np.full(CASES, 0.99), np.full(CASES, 0.95)),
    Pair("0.30 to 0.95, both", np.array(UNEQUAL), np.array(UNEQUAL)),
)


def main(arguments: Sequence[str] | None = None) -> None:
    """Prints the tables.

    Args:
        arguments: Options of the command line; None for those of this process.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--studies", type=int, default=1000, help="simulated studies per row")
    studies = parser.parse_args(arguments).studies
    if studies < 1:
        parser.error(f"argument --studies: expected 1 or more, got {studies}")
    coverage_of_proportions(studies, np.random.default_rng(1))
    coverage_of_numbers(studies, np.random.default_rng(2))
    family_errors(max(1, studies // 2), np.random.default_rng(3))
    power(max(1, studies // 5), np.random.default_rng(4))


def coverage_of_proportions(studies: int, rng: np.random.Generator) -> None:
    """Prints how often 95 % intervals of a paired difference contain it."""
    print("| proportions | seeds | dependence | bootstrap of runs | bootstrap of seeds | ours |")
    print("|---|---:|---:|---:|---:|---:|")
    for pair in PAIRS:
        for seeds in (4, 12):
            for dependence in DEPENDENCES:
                found = [
                    right([pair.first, pair.second], seeds, dependence, rng) for _ in range(studies)
                ]
                shares = (
                    _share([_contains(method, one, pair.difference, rng) for one in found])
                    for method in (over_runs, over_seeds, paired_proportion_interval)
                )
                print(f"| {pair.name} | {seeds} | {dependence:g} | {' | '.join(shares)} |")


def right(
    probabilities: list[FloatArray], seeds: int, dependence: float, rng: np.random.Generator
) -> FloatArray:
    """Returns which runs are right, ``(methods, seeds, cases)``, 1 or 0.

    A run is right where a normal number is below the quantile of its probability. The number has a
    part of the seed, for each method, and a part of the run, in part shared by the methods.
    """
    shape = (len(probabilities), seeds, CASES)
    shared, own = rng.standard_normal(shape[1:]), rng.standard_normal(shape)
    run = np.sqrt(SHARED) * shared + np.sqrt(1 - SHARED) * own
    of_seed = rng.standard_normal((*shape[:2], 1))
    number = np.sqrt(dependence) * of_seed + np.sqrt(1 - dependence) * run
    limits: FloatArray = stats.norm.ppf(np.array(probabilities))[:, None]
    return np.where(number < limits, 1.0, 0.0)


Method = Callable[[list[float], list[int], np.random.Generator], Interval]


def _contains(method: Method, found: FloatArray, truth: float, rng: np.random.Generator) -> bool:
    differences = found[0] - found[1]
    seeds = np.repeat(np.arange(len(differences)), differences.shape[1])
    interval = method(differences.ravel().tolist(), seeds.tolist(), rng)
    return interval.low - 1e-12 <= truth <= interval.high + 1e-12


def over_runs(differences: list[float], _seeds: list[int], rng: np.random.Generator) -> Interval:
    """Returns the percentile bootstrap over runs, which counts them as independent."""
    return _percentiles(np.array(differences), rng)


def over_seeds(differences: list[float], seeds: list[int], rng: np.random.Generator) -> Interval:
    """Returns the percentile bootstrap over seeds, without a correction for few of them."""
    return _percentiles(np.array(differences).reshape(len(set(seeds)), -1).mean(axis=1), rng)


def _percentiles(units: FloatArray, rng: np.random.Generator) -> Interval:
    weights = rng.multinomial(len(units), np.full(len(units), 1 / len(units)), 2000)
    low, high = np.quantile(weights @ units / len(units), (0.025, 0.975))
    return Interval(float(units.mean()), float(low), float(high))


def coverage_of_numbers(studies: int, rng: np.random.Generator) -> None:
    """Prints how often intervals of displacements contain their mean difference, and their mean.

    Displacements are log-normal with a standard deviation of 0.4 of the logarithm, in 4 cases; a
    share of the variance is the seed's.
    """
    print("\n| seeds | dependence | paired difference | marginal mean |\n|---:|---:|---:|---:|")
    scale, medians = 0.4, np.array([[6.0, 5.0, 4.0, 3.0], [5.0, 4.5, 4.0, 2.0]])
    truth = medians.mean(axis=1) * np.exp(scale**2 / 2)
    for seeds in (3, 6, 12):
        for dependence in DEPENDENCES:
            pairs, means = [], []
            for _ in range(studies):
                of_seed = np.sqrt(dependence) * rng.standard_normal((2, seeds, 1))
                run = np.sqrt(1 - dependence) * rng.standard_normal((2, seeds, 4))
                values = medians[:, None] * np.exp(scale * (of_seed + run))
                pairs.append(_contains(paired_interval, values, float(truth[0] - truth[1]), rng))
                mean = marginal_means(_outcomes(values[:1], "number")).iloc[0]
                means.append(mean["mean_low"] <= truth[0] <= mean["mean_high"])
            print(f"| {seeds} | {dependence:g} | {_share(pairs)} | {_share(means)} |")


def family_errors(studies: int, rng: np.random.Generator) -> None:
    """Prints how often any of 21 pairs of equally good methods is called different."""
    print(
        "\n| seeds | dependence | any McNemar p < 0.05 | Holm, runs | Holm, seeds | better |\n"
        "|---:|---:|---:|---:|---:|---:|"
    )
    for seeds in (4, 12):
        for dependence in DEPENDENCES:
            errors = np.zeros((studies, 4), dtype=bool)
            for study in range(studies):
                equal = right([np.array(UNEQUAL)] * METHODS, seeds, dependence, rng)
                found = compare(_outcomes(equal, "share"))
                errors[study] = (
                    any(found["p_runs"] < 0.05),
                    any(p < 0.05 for p in holm(found["p_runs"].tolist())),
                    any(p < 0.05 for p in holm(found["p_seeds"].tolist())),
                    any(found["better"].notna()),
                )
            print(f"| {seeds} | {dependence:g} | {' | '.join(map(_share, errors.T))} |")


def power(studies: int, rng: np.random.Generator) -> None:
    """Prints how often two methods that differ are called different, as the smallest p of 21 pairs.

    The second method is worse by the difference in every case.
    """
    print("\n| difference | dependence | 4 seeds | 8 seeds | 12 seeds | 24 seeds |")
    print("|---:|---:|---:|---:|---:|---:|")
    pairs = METHODS * (METHODS - 1) // 2
    good = 0.35 + 0.6 * np.array(UNEQUAL)  # so that no proportion is below 0
    for difference in (0.1, 0.2, 0.3):
        for dependence in DEPENDENCES:
            shares = []
            for seeds in (4, 8, 12, 24):
                simulated = (
                    right([good, good - difference], seeds, dependence, rng) for _ in range(studies)
                )
                found = [compare(_outcomes(one, "share")).iloc[0] for one in simulated]
                shares.append([max(one["p_runs"], one["p_seeds"]) < 0.05 / pairs for one in found])
            print(f"| {difference:g} | {dependence:g} | {' | '.join(map(_share, shares))} |")


def _outcomes(values: FloatArray, measure: str) -> pd.DataFrame:
    """Returns the outcomes of simulated values, ``(methods, seeds, cases)``."""
    found = [
        (("simulated",), f"method {method}", (f"case {case}",), seed, float(value), measure)
        for (method, seed, case), value in np.ndenumerate(values)
    ]
    return pd.DataFrame(found, columns=list(OUTCOME))


def _share(of: ArrayLike) -> str:
    return f"{100 * np.asarray(of, dtype=bool).mean():.1f} %"


if __name__ == "__main__":
    main()
