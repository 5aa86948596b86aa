"""Promises of hidden neurons as an option: the model says how many, and is otherwise the same."""

import numpy as np
import pytest

from selfmodel.errors import InputError
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.robot.custom_numerics import NEURONS
from selfmodel.robot.parameters import nominal, with_parameters
from selfmodel.robot.robot import Robot, with_neurons
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import SIGNALS
from tests.conftest import random_controllers


def test_the_network_has_as_many_as_are_asked_for_and_each_can_fall_silent(robot: Robot):
    large = with_neurons(robot, 7)
    sensors, motors = len(robot.anatomy.sensors), len(robot.anatomy.motors)

    assert large.network.weights == 7 * (sensors + 1) + 7 * 7 + motors * 8
    assert str(parse("neuron:6", large.anatomy)) == "neuron:6"
    with pytest.raises(InputError, match="neuron"):
        parse("neuron:6", robot.anatomy)
    assert np.array_equal(build(large, parse("neuron:6", large.anatomy)).neurons, [1] * 6 + [0])


def test_asking_for_those_that_it_has_leaves_it_as_it_is(robot: Robot):
    assert with_neurons(robot, 3) is robot


def test_asking_again_takes_the_place_of_what_was_asked_before(quadruped: Robot):
    again = with_neurons(with_neurons(quadruped, 7), 3)

    assert again.anatomy == quadruped.anatomy
    assert again.mjcf.count(NEURONS) == 1


def test_the_robot_moves_the_same_to_the_bit(robot: Robot):
    runs = [(INTACT, one) for one in random_controllers(robot, 2)]
    other = with_neurons(with_neurons(robot, 4), 3)
    before = Simulator(robot, 1).run(runs, 100, SIGNALS).behaviour
    after = Simulator(other, 1).run(runs, 100, SIGNALS).behaviour

    assert all(before[signal].tobytes() == after[signal].tobytes() for signal in SIGNALS)


def test_a_calibrated_robot_keeps_them(quadruped: Robot):
    large = with_neurons(quadruped, 6)

    assert with_parameters(large, nominal(large)).anatomy.neurons == 6


@pytest.mark.parametrize("neurons", [0, -1, 101])
def test_too_many_or_none_are_refused(quadruped: Robot, neurons: int):
    with pytest.raises(InputError, match="a network has 1 to 100 hidden neurons, got"):
        with_neurons(quadruped, neurons)


@pytest.mark.parametrize("said", ["0", "2.5", "101", "1e9", "-3"])
def test_a_model_that_says_what_cannot_be_is_refused(quadruped: Robot, said: str):
    mjcf = with_neurons(quadruped, 5).mjcf.replace('data="5"', f'data="{said}"')
    with pytest.raises(ValueError, match=f"{NEURONS} must be a whole number from 1 to 100"):
        Robot("odd", mjcf, 0.01)
