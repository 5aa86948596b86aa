"""Comparisons of all pairs of methods on the runs that both have."""

import itertools
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from selfmodel.experiments.confidence_intervals import Interval
from selfmodel.experiments.statistics.holm import holm
from selfmodel.experiments.statistics.outcome import (
    Cell,
    Outcome,
    by_method,
    by_table,
    measure_of,
)
from selfmodel.experiments.statistics.paired_interval import (
    paired_interval,
    paired_proportion_interval,
)
from selfmodel.experiments.statistics.paired_tests import exact_mcnemar, seed_test, sign_flip_test

LEVEL = 0.05
"""Largest probability of any false "better" in a table."""


@dataclass(frozen=True)
class Comparison:
    """Paired comparison of two methods.

    Attributes:
        table: Names of the table: robot, number of trials, measure.
        first: Name of the method with the larger mean.
        second: Name of the other method.
        runs: Number of runs that both have.
        seeds: Number of their seeds.
        first_mean: Mean of the first on these runs.
        second_mean: Mean of the second.
        difference: Mean difference, first minus second, with its 95 % interval over seeds.
        only_first: Number of runs in which the first is larger: for right and wrong, in which only
            the first is right.
        only_second: Number of runs in which the second is larger.
        p_runs: Of the exact McNemar test for a share; of the sign-flip test for numbers.
        p_runs_holm: The same, corrected for the number of pairs in the table.
        p_seeds: Of Student's paired test over the means of the seeds.
        p_holm: The larger of ``p_runs`` and ``p_seeds``, corrected in the same way.
    """

    table: Cell
    first: str
    second: str
    runs: int
    seeds: int
    first_mean: float
    second_mean: float
    difference: Interval
    only_first: int
    only_second: int
    p_runs: float
    p_runs_holm: float
    p_seeds: float
    p_holm: float

    @property
    def better(self) -> str | None:
        """The first method if it differs from the second by the tests, else None."""
        return self.first if self.p_holm < LEVEL else None


def compare(outcomes: Iterable[Outcome], seed: int = 0) -> tuple[Comparison, ...]:
    """Returns the comparisons of all pairs of methods of each table.

    Two methods differ if a test over runs and a test over seeds both reject equality: the first is
    wrong where runs of one seed depend on each other, the second where the means of few runs are
    equal by chance. The larger p is corrected for the number of pairs of its table by Holm's
    method; several tables are not corrected for each other. Errors by simulation:
    ``docs/results/statistics.md``.

    Args:
        outcomes: Outcomes of all methods.
        seed: Seed of the bootstrap and of the sign flips, the same for each pair.
    """
    found: list[Comparison] = []
    for table, own in by_table(outcomes).items():
        methods = by_method(own)
        test = _of_proportions if measure_of(own) == "share" else _of_numbers
        pairs = [
            comparison
            for pair in itertools.combinations(methods, 2)
            if (comparison := _compared(table, pair, methods, test, seed)) is not None
        ]
        over_runs = holm([one.p_runs for one in pairs])
        over_both = holm([max(one.p_runs, one.p_seeds) for one in pairs])
        found += [
            replace(one, p_runs_holm=p_runs, p_holm=p)
            for one, p_runs, p in zip(pairs, over_runs, over_both, strict=True)
        ]
    return tuple(found)


def _compared(
    table: Cell,
    pair: tuple[str, str],
    methods: Mapping[str, Mapping[tuple[Cell, int], float]],
    test: "Test",
    seed: int,
) -> Comparison | None:
    """Returns the comparison of a pair, not corrected; None without a common run."""
    runs = sorted(methods[pair[0]].keys() & methods[pair[1]].keys())
    if not runs:
        return None
    values = {name: [methods[name][run] for run in runs] for name in pair}
    means = {name: float(np.mean(values[name])) for name in pair}
    first, second = sorted(pair, key=lambda name: -means[name])  # stable: by name if equal
    differences = [a - b for a, b in zip(values[first], values[second], strict=True)]
    seeds = [run_seed for _, run_seed in runs]
    rng = np.random.default_rng(seed)
    difference, p = test(differences, seeds, rng)
    return Comparison(
        table=table,
        first=first,
        second=second,
        runs=len(runs),
        seeds=len(set(seeds)),
        first_mean=means[first],
        second_mean=means[second],
        difference=difference,
        only_first=sum(one > 0 for one in differences),
        only_second=sum(one < 0 for one in differences),
        p_runs=p,
        p_runs_holm=1.0,
        p_seeds=seed_test(differences, seeds),
        p_holm=1.0,
    )


Test = Callable[[list[float], list[int], np.random.Generator], tuple[Interval, float]]
"""Function of the differences and the seed of each run to their mean and its p over runs."""


def _of_proportions(
    differences: list[float], seeds: list[int], rng: np.random.Generator
) -> tuple[Interval, float]:
    p = exact_mcnemar([one > 0 for one in differences], [one < 0 for one in differences])
    return paired_proportion_interval(differences, seeds, rng), p


def _of_numbers(
    differences: list[float], seeds: list[int], rng: np.random.Generator
) -> tuple[Interval, float]:
    return paired_interval(differences, seeds, rng), sign_flip_test(differences, rng)
