"""Tests of custom numerics: the hidden neurons that a log of version 0.1 has in its MJCF."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.logs import read_log
from selfmodel.logs.records import TrialHeader
from selfmodel.logs.robots import robot_of
from selfmodel.logs.writer import write_trial
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.model_factors import nominal, with_parameters
from selfmodel.simulation.requests import cut_segments
from selfmodel.simulation.simulator import Simulator
from selfmodel.simulation.trial_replay import replay
from selfmodel.trials.behaviour import collect
from selfmodel.trials.estimation import STATE
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trial import TrialPlan
from tests.helpers.drivers import random_controllers, random_of


def of_0_1(robot: Robot, hidden: str) -> Robot:
    """Returns the robot with the custom numeric of version 0.1."""
    numeric = f'<custom><numeric name="selfmodel_hidden_neurons" data="{hidden}"/></custom>'
    return Robot(
        robot.name,
        robot.mjcf.replace("</mujoco>", f"{numeric}</mujoco>"),
        robot.control_timestep,
        robot.assets,
    )


def test_a_robot_of_0_1_moves_the_same_to_the_bit(robot: Robot):
    runs = [(INTACT, one) for one in random_controllers(robot, 2)]
    before = Simulator(robot, 1).run(runs, 100, SIGNALS).behaviour
    after = Simulator(of_0_1(robot, "4"), 1).run(runs, 100, SIGNALS).behaviour

    assert all(before[signal].tobytes() == after[signal].tobytes() for signal in SIGNALS)


@pytest.mark.parametrize("hidden", ["0", "2.5", "101", "1e9", "-3", "7"])
def test_the_hidden_neurons_of_0_1_are_ignored(quadruped: Robot, hidden: str):
    old = of_0_1(quadruped, hidden)

    assert old.anatomy == quadruped.anatomy
    assert network_for(old) == network_for(quadruped)


def test_a_log_of_0_1_replays_with_the_neurons_of_its_controller(quadruped: Robot, tmp_path: Path):
    old, path = of_0_1(quadruped, "5"), tmp_path / "old.mcap"
    (controller,) = random_of(network_for(quadruped, 5), 1)
    plan = TrialPlan("trial", "single", controller, 60, 0)
    samples = SimulatedRobot(old, parse("neuron:4", old.anatomy)).run(controller, 60)
    write_trial(path, old, plan, samples, TrialHeader(Settings()))
    log = read_log(path)
    robot = robot_of(log)

    assert "selfmodel_hidden_neurons" in robot.mjcf
    assert log.trial.plan.controller == controller
    assert replay(log.trial, parse("neuron:4", robot.anatomy), Simulator(robot, 1)).identical
    assert not replay(log.trial, INTACT, Simulator(robot, 1)).identical


def test_a_calibrated_robot_of_0_1_keeps_its_controllers(quadruped: Robot):
    old = of_0_1(quadruped, "6")
    fitted = with_parameters(old, nominal(old))
    (controller,) = random_of(network_for(quadruped, 6), 1)
    run = Simulator(fitted, 1).run([(INTACT, controller)], 5, ["commands"])

    assert fitted.mjcf.count("selfmodel_hidden_neurons") == 1
    assert np.isfinite(run.behaviour["commands"]).all()


@pytest.mark.parametrize("delay", [0.5, 1.5, 4.5])
def test_a_part_of_a_step_is_exact_in_all_simulations(quadruped: Robot, delay: float):
    late = with_parameters(quadruped, dataclasses.replace(nominal(quadruped), delay=delay))
    (controller,) = random_controllers(late, 1)
    physical = collect(late.anatomy.names, SimulatedRobot(late).run(controller, 60))
    simulated = Simulator(late, 1).run([(INTACT, controller)], 60, SIGNALS).behaviour
    states = {signal: physical[signal] for signal in STATE}
    segments = cut_segments(physical, states, np.array([0, 20, 40]), 10, STATE)
    predicted = Simulator(late, 1).predict([INTACT], segments).behaviour

    assert late.control_delay == delay
    assert all(physical[signal].tobytes() == simulated[signal][0].tobytes() for signal in SIGNALS)
    for signal in STATE:
        logged = physical[signal][[[0, 10], [20, 30], [40, 50]]]
        np.testing.assert_allclose(predicted[signal][0][:, [0, 10]], logged, atol=1e-9)


def test_a_delay_of_half_a_step_is_between_its_neighbours(quadruped: Robot):
    (controller,) = random_controllers(quadruped, 1)

    def moved(delay: float) -> np.ndarray:
        late = with_parameters(quadruped, dataclasses.replace(nominal(quadruped), delay=delay))
        run = Simulator(late, 1).run([(INTACT, controller)], 8, ["joint_positions"])
        return run.behaviour["joint_positions"][0, 2]

    assert not np.array_equal(moved(0.5), moved(0))
    assert not np.array_equal(moved(0.5), moved(1))
