"""Tests of command errors: exact, and NaN where the controller's state is unknown."""

import dataclasses

import numpy as np
import pytest

from selfmodel.comparators.readings import command_errors, command_spans
from selfmodel.controllers.controller import Controller
from selfmodel.controllers.playback import Playback
from selfmodel.faults.notation import parse
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trial import Trial, TrialPlan
from tests.helpers.drivers import random_controllers, random_cpgs
from tests.helpers.memory import in_memory

STEPS = 60


def trial(robot: Robot, truth: str = "intact", number: int = 0) -> Trial:
    controller = random_controllers(robot, number + 1)[number]
    physical = SimulatedRobot(robot, parse(truth, robot.anatomy))
    return in_memory(robot)(physical, TrialPlan("t", "after", controller, STEPS, 0))


def with_signals(one: Trial, **signals: np.ndarray) -> Trial:
    behaviour = one.behaviour
    changed = {**{signal: behaviour[signal] for signal in SIGNALS}, **signals}
    return dataclasses.replace(one, behaviour=Behaviour(behaviour.names, behaviour.time, changed))


@pytest.mark.parametrize("truth", ["intact", "break:front_left_knee", "sensor:front_left_angle"])
def test_a_working_controller_has_errors_of_exactly_0_under_any_other_fault(
    robot: Robot, truth: str
):
    one = trial(robot, truth.replace("front_left_knee", robot.anatomy.joints[0].name))

    assert np.array_equal(command_errors(one), np.zeros((STEPS, len(robot.anatomy.motors))))


def of_a_cpg(robot: Robot, truth: str) -> Trial:
    """A trial of a CPG."""
    (driver,) = random_cpgs(robot, 1)
    physical = SimulatedRobot(robot, parse(truth, robot.anatomy))
    return in_memory(robot)(physical, TrialPlan("t", "after", driver, STEPS, 0))


@pytest.mark.parametrize("truth", ["intact", "sensor:front_left_angle"])
def test_a_working_cpg_has_errors_of_exactly_0(robot: Robot, truth: str):
    assert not command_errors(of_a_cpg(robot, truth)).any()


def test_a_changed_reading_shifts_the_phase_of_a_cpg_from_the_next_step(quadruped: Robot):
    one = of_a_cpg(quadruped, "intact")
    readings = one.behaviour["sensors"].copy()
    readings[30, 5] += 5
    errors = command_errors(with_signals(one, sensors=readings))

    assert not errors[:31].any()
    assert errors[31:].all(axis=1).any()


def test_command_spans_are_relative_to_the_paper_s_range(quadruped: Robot):
    one = trial(quadruped)
    network = network_for(quadruped)
    wide = dataclasses.replace(network, ranges=((0.0, np.pi / 2), *network.ranges[1:]))
    driver = Controller(wide, one.plan.controller.genome)
    other = dataclasses.replace(one, plan=dataclasses.replace(one.plan, controller=driver))

    assert np.array_equal(command_spans(one), np.ones(8))
    assert np.array_equal(command_spans(other), [2, *np.ones(7)])


@pytest.mark.parametrize("neuron", [0, 1, 2])
def test_a_silent_neuron_causes_errors_in_every_motor_at_once(robot: Robot, neuron: int):
    errors = command_errors(trial(robot, f"neuron:{neuron}"))

    assert np.abs(errors[0]).max() > 0.01
    assert np.all(np.abs(errors).max(axis=0) > 0.01)


def test_a_wrong_command_is_the_error_at_its_step_and_motor(quadruped: Robot):
    one = trial(quadruped)
    commands = one.behaviour["commands"].copy()
    commands[20, 3] += 0.25
    errors = command_errors(with_signals(one, commands=commands))

    assert errors[20, 3] == pytest.approx(0.25)
    errors[20, 3] = 0
    assert not errors.any()


def test_a_changed_reading_causes_errors_of_a_network_from_its_step(quadruped: Robot):
    one = trial(quadruped)
    readings = one.behaviour["sensors"].copy()
    readings[30, 5] += 0.5
    errors = command_errors(with_signals(one, sensors=readings))

    assert not errors[:30].any()
    assert errors[30].any()
    assert errors[31].any()  # recurrent connections


def test_errors_are_nan_from_the_first_unobserved_reading(quadruped: Robot):
    one = trial(quadruped)
    readings = one.behaviour["sensors"].copy()
    readings[25, 2] = np.nan
    errors = command_errors(with_signals(one, sensors=readings))

    assert np.array_equal(errors[:25], np.zeros((25, len(quadruped.anatomy.motors))))
    assert np.isnan(errors[25:]).all()


def test_the_error_of_an_unobserved_command_alone_is_nan(quadruped: Robot):
    one = trial(quadruped)
    commands = one.behaviour["commands"].copy()
    commands[10] = np.nan
    errors = command_errors(with_signals(one, commands=commands))

    assert np.isnan(errors[10]).all()
    assert not np.delete(errors, 10, axis=0).any()


def test_a_playback_has_errors_of_exactly_0(quadruped: Robot):
    one = trial(quadruped, "neuron:0")
    driver = Playback(quadruped.anatomy.motors, one.behaviour["commands"])
    played = dataclasses.replace(one, plan=dataclasses.replace(one.plan, controller=driver))

    assert np.array_equal(command_errors(played), np.zeros((STEPS, len(driver.motors))))
