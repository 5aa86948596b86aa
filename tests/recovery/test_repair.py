"""The repair search: its start, and the fitness of a diverged gait."""

import dataclasses

import numpy as np
import pytest

from selfmodel.errors import WorkError
from selfmodel.faults.hypothesis import INTACT
from selfmodel.recovery.repair import RepairSearch
from selfmodel.robot.designs import DESIGNS
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.domain import DomainDistribution
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import forward_displacement
from tests.helpers.drivers import random_controllers, random_cpgs
from tests.helpers.hostile import unstable

SMALL = dataclasses.replace(Settings().scaled(20), generations=1, steps=200)


def test_a_repair_starts_from_the_controllers_it_is_given(quadruped: Robot):
    seeds = random_controllers(quadruped, 20, seed=3)
    simulator = Simulator(quadruped, 2)
    given = assumed, seeds, np.random.default_rng(0), lambda _: None
    best = RepairSearch(simulator, SMALL)((INTACT,), *given)[0].controller
    runs = [(INTACT, seed) for seed in seeds]
    behaviour = simulator.run(runs, SMALL.steps, ["base_position"]).behaviour

    assert best == seeds[int(np.argmax(forward_displacement(behaviour)))]


def test_its_candidates_are_the_survivors_with_their_fitness_best_first(quadruped: Robot):
    seeds = random_controllers(quadruped, 20, seed=3)
    simulator = Simulator(quadruped, 2)
    numbers = dataclasses.replace(SMALL, generations=2, mutation=0.01)
    given = seeds, np.random.default_rng(0), lambda _: None
    found = RepairSearch(simulator, numbers)([INTACT], assumed, *given)
    runs = [(INTACT, one.controller) for one in found]
    fitness = forward_displacement(simulator.run(runs, 200, ["base_position"]).behaviour)
    assert [one.predicted for one in found] == fitness.tolist() == sorted(fitness)[::-1]
    assert 1 < len({one.controller for one in found}) == len(found) <= numbers.survivors


def assumed() -> DomainDistribution:
    """The uncertainty of a repair that asks for none."""
    raise AssertionError("the paper's repair simulates the self-model alone")


def test_a_repair_that_no_simulation_survives_is_an_error(quadruped: Robot):
    few = dataclasses.replace(Settings().scaled(4), generations=1, steps=20)
    search = RepairSearch(Simulator(unstable(quadruped), 2), few)
    with pytest.raises(WorkError, match="no simulation of quadruped as intact remained finite, wi"):
        search((INTACT,), assumed, (), np.random.default_rng(0), lambda _: None)


def test_a_search_for_one_kind_does_not_start_from_controllers_of_the_other(quadruped: Robot):
    seeds = [*random_controllers(quadruped, 2), *random_cpgs(quadruped, 2)]
    for kind in ("network", "cpg"):
        design = DESIGNS[kind](quadruped, None)
        search = RepairSearch(Simulator(quadruped, 1), dataclasses.replace(SMALL, steps=60), design)
        rest = None, seeds, np.random.default_rng(0), lambda _generation: None
        assert {one.controller.design for one in search((INTACT,), *rest)} == {design}
