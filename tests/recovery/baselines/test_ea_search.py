"""The paper's EA as the search of a baseline."""

import numpy as np
import pytest

from selfmodel.controllers.controller import Controller
from selfmodel.recovery.baselines.ea_search import ea_search
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from tests.recovery.baselines.problems import fitness


@pytest.mark.parametrize(("evaluations", "spent"), [(8, 8), (30, 32), (4, 8)])
def test_a_search_spends_its_evaluations_and_returns_the_best_first(
    quadruped: Robot, evaluations: int, spent: int
):
    evaluated: list[Controller] = []

    def counted(controllers: list[Controller]) -> np.ndarray:
        evaluated.extend(controllers)
        return fitness(controllers)

    search = ea_search(Settings().scaled(8))
    found = search(network_for(quadruped), counted, evaluations, np.random.default_rng(0))

    assert len(evaluated) == spent
    assert len(found) == len(set(evaluated))
    assert fitness(found).tolist() == sorted(fitness(list(set(evaluated))), reverse=True)
