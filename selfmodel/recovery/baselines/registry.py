"""The baselines by name."""

from collections.abc import Mapping
from types import MappingProxyType

from selfmodel.recovery.baselines.healthy_evolution import healthy_evolution
from selfmodel.recovery.baselines.oracle import oracle
from selfmodel.recovery.baselines.physical_evolution import physical_evolution
from selfmodel.recovery.baselines.problem import Baseline
from selfmodel.recovery.baselines.random_search import random_search
from selfmodel.recovery.baselines.t_resilience import t_resilience
from selfmodel.recovery.baselines.trial_and_error import trial_and_error

ORACLE = "oracle"
"""Name of the bound, which is no method."""

BASELINES: Mapping[str, Baseline] = MappingProxyType(
    {
        ORACLE: oracle,
        "physical-evolution": physical_evolution,
        "trial-and-error": trial_and_error,
        "healthy-evolution": healthy_evolution,
        "random-search": random_search,
        "t-resilience": t_resilience,
    }
)
"""Every baseline by its name."""
