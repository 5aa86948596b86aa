"""Promises of the reality gap: its factors, their spreads, and the models that have them."""

import dataclasses
import json

import numpy as np
import pytest

from selfmodel.errors import InputError
from selfmodel.physical.simulated import draw_gap
from selfmodel.recovery.recover import random_stream
from selfmodel.robot.robot import Robot
from selfmodel.simulation.reality_gap import (
    MAX_EXTRA_DELAY,
    MAX_GAP_LEVEL,
    MIN_FACTOR,
    RealityGap,
    perturbed_model,
)
from selfmodel.tasks import ROBOTS
from tests.helpers.exactness import bits

QUADRUPED = ROBOTS["quadruped"].robot()
DRAWS = 400


def drawn(level: float, seed: int = 0, robot: Robot = QUADRUPED) -> RealityGap:
    return draw_gap(robot, level, np.random.default_rng(seed))


def factors(gap: RealityGap) -> np.ndarray:
    each = (gap.mass, gap.inertia, gap.motors)
    return np.array([gap.friction, gap.damping, *(f for kind in each for f in kind.values())])


def test_at_level_0_nothing_differs(robot: Robot):
    gap = drawn(0.0, 3, robot)

    assert set(factors(gap)) == {1.0}
    assert gap.delay == 0
    assert bits(perturbed_model(robot.model, gap)) == bits(robot.model)


@pytest.mark.parametrize("seed", range(2))
def test_the_same_seed_draws_the_same_robot_at_any_distance_from_its_model(seed: int):
    for level in (0.01, 0.09, MAX_GAP_LEVEL / 2):
        narrow, wide = drawn(level, seed), drawn(2 * level, seed)
        further = 2 * (factors(narrow) - 1)
        kept = (factors(narrow) > MIN_FACTOR) & (1 + further > MIN_FACTOR)

        assert narrow == drawn(level, seed)
        assert min(factors(wide)) >= MIN_FACTOR
        np.testing.assert_allclose((factors(wide) - 1)[kept], further[kept], atol=1e-12)
        assert (narrow.delay, narrow.seed) == (wide.delay, wide.seed)
        assert set(wide.motors) == set(QUADRUPED.anatomy.motors)
        assert len(wide.mass) == len(wide.inertia) == QUADRUPED.model.nbody - 1
        assert json.loads(wide.text) == {**dataclasses.asdict(wide), "structure": None}


def test_each_quantity_has_its_own_spread_and_delays_are_equally_frequent():
    """Over 400 draws a standard deviation is known to within 3.5 %, five of which are allowed."""
    level = 0.05
    gaps = [drawn(level, seed) for seed in range(DRAWS)]
    table = np.array([factors(gap) for gap in gaps])
    expected = np.full(table.shape[1], level)
    expected[:2] *= 2  # friction and damping

    assert np.all(np.abs(table.mean(axis=0) - 1) < 5 * expected / np.sqrt(DRAWS))
    assert np.all(np.abs(table.std(axis=0) / expected - 1) < 0.18)
    together = np.corrcoef(table.T) - np.eye(len(expected))
    assert np.abs(together).max() < 5 / np.sqrt(DRAWS), "two quantities are drawn together"
    counts = np.bincount([gap.delay for gap in gaps])
    assert len(counts) == MAX_EXTRA_DELAY + 1 == 3
    assert np.abs(counts - DRAWS / 3).max() < 5 * np.sqrt(DRAWS * 2 / 9)


@pytest.mark.parametrize("level", [-0.01, 0.51, float("nan"), float("inf")])
def test_a_level_out_of_range_is_refused(level: float):
    with pytest.raises(InputError, match=r"level from 0 \(none\) to 0\.5, such as 0\.05, got"):
        drawn(level)


def test_a_perturbed_model_is_what_the_gap_says_and_leaves_the_robot_as_it_was(robot: Robot):
    gap, model, before = drawn(0.2, 1, robot), robot.model, bits(robot.model)
    found = perturbed_model(model, gap)

    for b in range(1, model.nbody):
        name = model.body(b).name
        np.testing.assert_allclose(found.body_mass[b], model.body_mass[b] * gap.mass[name])
        np.testing.assert_allclose(found.body_inertia[b], model.body_inertia[b] * gap.inertia[name])
    # Derived numbers follow the masses.
    np.testing.assert_allclose(found.body_subtreemass[0], found.body_mass.sum())
    np.testing.assert_allclose(found.geom_friction[:, 0], model.geom_friction[:, 0] * gap.friction)
    np.testing.assert_array_equal(found.geom_friction[:, 1:], model.geom_friction[:, 1:])
    np.testing.assert_allclose(found.dof_damping, model.dof_damping * gap.damping)
    for name, factor in gap.motors.items():
        motor = model.actuator(name).id
        for field in ("actuator_gainprm", "actuator_biasprm"):
            expected = getattr(model, field)[motor] * factor
            np.testing.assert_allclose(getattr(found, field)[motor], expected)
    np.testing.assert_array_equal(found.actuator_forcerange, model.actuator_forcerange)
    assert bits(model) == before


def test_the_gap_is_drawn_from_a_stream_of_its_own():
    draws = [draw_gap(QUADRUPED, 0.1, random_stream(seed, "gap")) for seed in (0, 0, 1)]

    assert draws[0] == draws[1] != draws[2]
