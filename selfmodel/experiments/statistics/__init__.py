"""Statistics of paired comparisons: pure functions over outcomes, without files and figures."""

from selfmodel.experiments.statistics.balance import Imbalance, balance_warnings, imbalances
from selfmodel.experiments.statistics.comparison import Comparison, compare
from selfmodel.experiments.statistics.holm import holm
from selfmodel.experiments.statistics.marginal_mean import MarginalMean, marginal_means
from selfmodel.experiments.statistics.outcome import Outcome
from selfmodel.experiments.statistics.paired_interval import (
    paired_interval,
    paired_proportion_interval,
)
from selfmodel.experiments.statistics.paired_tests import exact_mcnemar, seed_test, sign_flip_test

__all__ = [
    "Comparison",
    "Imbalance",
    "MarginalMean",
    "Outcome",
    "balance_warnings",
    "compare",
    "exact_mcnemar",
    "holm",
    "imbalances",
    "marginal_means",
    "paired_interval",
    "paired_proportion_interval",
    "seed_test",
    "sign_flip_test",
]
