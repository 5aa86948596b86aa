"""Displacement and falls of physical runs."""

import pytest

from selfmodel.errors import TrialError
from selfmodel.experiments.reality import simulated_robot
from selfmodel.faults.hypothesis import INTACT
from selfmodel.recovery.baselines.measurement import Measured, Track, fitness_on, measure
from selfmodel.robot.robot import Robot
from selfmodel.simulation.outcome import SimulationStats
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import forward_displacement
from tests.helpers.drivers import random_controllers
from tests.helpers.stub_robot import StubRobot
from tests.recovery.baselines.problems import LEVEL


def measured(robot: Robot, **given: int) -> Measured:
    (controller,) = random_controllers(robot, 1)
    return measure(Track(StubRobot(robot, lambda _: 1.0, **given), robot, LEVEL, 11), controller)


def test_a_run_without_a_fall_has_its_whole_displacement(quadruped: Robot):
    assert measured(quadruped) == Measured(pytest.approx(1), pytest.approx(1), False, 11)


def test_what_follows_a_fall_does_not_count_as_upright(quadruped: Robot):
    found = measured(quadruped, falls_after=6)

    assert found == Measured(pytest.approx(1), pytest.approx(0.5), True, 11)


def test_a_run_that_ends_early_counts_as_far_as_it_went(quadruped: Robot):
    assert measured(quadruped, ends_after=6) == Measured(
        pytest.approx(0.5), pytest.approx(0.5), False, 6
    )


def test_a_run_without_any_sample_is_an_error(quadruped: Robot):
    with pytest.raises(TrialError, match="the robot failed"):
        measured(quadruped, ends_after=0)


def test_fitness_on_a_robot_without_a_gap_is_that_of_the_self_model(quadruped: Robot):
    controllers, stats = random_controllers(quadruped, 3), SimulationStats()
    fitness = fitness_on(Track(simulated_robot(quadruped), quadruped, LEVEL, 20), stats)
    runs = [(INTACT, one) for one in controllers]
    simulated = Simulator(quadruped, 1).run(runs, 20, ["base_position"]).behaviour

    assert fitness(controllers).tolist() == forward_displacement(simulated).tolist()
    assert (stats.runs, stats.steps) == (3, 60)
