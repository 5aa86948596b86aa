"""The selection of NSGA-II."""

import numpy as np
import pytest

from selfmodel.recovery.baselines.pareto import best_first, crowding, ranks


def test_a_front_has_what_only_earlier_fronts_dominate():
    objectives = np.random.default_rng(0).integers(0, 5, size=(40, 3)).astype(float)
    fronts = ranks(objectives)

    for k, one in enumerate(objectives):
        dominating = (objectives >= one).all(axis=1) & (objectives > one).any(axis=1)
        assert fronts[k] == max(fronts[dominating], default=-1) + 1


def test_solutions_in_empty_regions_have_the_largest_distance():
    objectives = np.array([[0, 4], [1, 3], [1.2, 2.8], [4, 0]])
    distances = crowding(objectives, np.zeros(4, dtype=int))

    assert distances[[0, 3]].tolist() == [np.inf, np.inf]
    assert distances[1:3] == pytest.approx([0.6, 1.5])


def test_fronts_come_first_and_crowded_solutions_last():
    objectives = np.array([[0, 0], [0, 4], [1, 3], [1.2, 2.8], [4, 0]])

    assert best_first(objectives).tolist() == [1, 4, 3, 2, 0]
