"""Promises of the searches of baselines: their cost, and the best first."""

from functools import partial

import numpy as np
import pytest

from selfmodel.controllers.controller import Controller
from selfmodel.evolution import Evolution
from selfmodel.recovery.baselines.genome_search import KEPT, genome_search
from selfmodel.recovery.cma_es import CmaEs
from selfmodel.recovery.robust_repair import MakeSearch
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from tests.recovery.baselines.problems import fitness

NOISY_EA = partial(Evolution, noisy=True)


@pytest.mark.parametrize("make", [CmaEs, NOISY_EA])
@pytest.mark.parametrize("evaluations", [8, 30, 200])
def test_a_search_spends_its_evaluations_and_returns_the_best_first(
    quadruped: Robot, make: MakeSearch, evaluations: int
):
    evaluated: list[Controller] = []

    def counted(controllers: list[Controller]) -> np.ndarray:
        evaluated.extend(controllers)
        return fitness(controllers)

    search = genome_search(make, Settings().scaled(8))
    found = search(network_for(quadruped), counted, evaluations, np.random.default_rng(0))

    assert evaluations <= len(evaluated) <= evaluations + 16 + KEPT
    assert len(found) == min(KEPT, len(set(evaluated)))
    best = sorted(fitness(list(set(evaluated))), reverse=True)[: len(found)]
    assert fitness(found).tolist() == best
