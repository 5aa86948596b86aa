"""Contract tests of every robot, parametrised over the registry."""

import numpy as np
import pytest

from selfmodel import tasks
from selfmodel.controllers.controller import Controller, make_batch
from selfmodel.errors import InputError
from selfmodel.faults.notation import parse
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.tasks import ROBOTS
from selfmodel.trials.trajectory import forward_displacement
from tests.helpers.drivers import random_controllers

STANDING_DRIFT = 0.05
"""Maximum drift of a standing robot in one run, m."""


def test_its_parts_are_named_for_their_limbs(robot: Robot):
    legs = {
        joint.name.removesuffix("_knee") for joint in robot.anatomy.joints if "knee" in joint.name
    }

    assert len(legs) == {"quadruped": 4, "hexapod": 6}[robot.name]
    proximal = {"quadruped": "shoulder", "hexapod": "hip"}[robot.name]
    assert {joint.name for joint in robot.anatomy.joints} == {
        f"{leg}_{part}" for leg in legs for part in (proximal, "knee")
    }
    assert {sensor.name for sensor in robot.anatomy.sensors} == {
        f"{leg}_{kind}" for leg in legs for kind in ("touch", "angle")
    }


def test_its_joints_flex_and_extend_thirty_degrees(robot: Robot):
    for joint in robot.anatomy.joints:
        np.testing.assert_allclose(joint.limits, [[-np.pi / 6, np.pi / 6]] * len(joint.limits))


def test_told_to_stand_it_stands(robot: Robot):
    still = Controller(network_for(robot), np.zeros(network_for(robot).weights))
    path = Simulator(robot, 1).run(
        [(parse("intact", robot.anatomy), still)], 1000, ["base_position"]
    )
    position = path.trajectory["base_position"][0]
    drift = np.linalg.norm(position[:, :2] - position[0, :2], axis=1)

    assert not path.diverged.any()
    assert drift.max() < STANDING_DRIFT
    assert position[:, 2].min() > 0.8 * robot.standing_height


def test_every_case_of_table_one_is_a_hypothesis_about_it(robot: Robot):
    cases = ROBOTS[robot.name].cases
    parsed = {number: parse(text, robot.anatomy) for number, text in cases.items()}

    assert sorted(cases) == list(range(1, 11))
    assert {number: str(hypothesis) for number, hypothesis in parsed.items()} == dict(cases)
    assert [len(parsed[number]) for number in sorted(parsed)] == [1, 1, 1, 2, 1, 1, 2, 3, 0, 1]


@pytest.mark.parametrize(("domain", "case"), [("quadruped", 2), ("hexapod", 5), ("quadruped", 7)])
def test_an_environment_moves_like_the_simulator_to_the_bit(domain: str, case: int):
    robot = ROBOTS[domain].robot()
    hypothesis = ROBOTS[domain].cases[case]
    (controller,) = random_controllers(robot, 1, seed=case)
    truth = Simulator(robot, 1).run(
        [(parse(hypothesis, robot.anatomy), controller)], 100, ["sensors", "base_position"]
    )
    environment = tasks.load(domain, "walk", task_kwargs={"hypothesis": hypothesis})
    brain = make_batch([controller], [frozenset()], len(robot.anatomy.sensors))
    action = np.empty((1, robot.model.nu))
    step, travelled = environment.reset(), 0.0
    for k in range(100):
        readings = step.observation["sensors"]
        assert readings.tobytes() == truth.trajectory["sensors"][0, k].tobytes()
        brain.readings[:] = readings
        brain.step(action)
        if k < 99:
            step = environment.step(action[0])
            travelled += step.reward * environment.control_timestep()

    assert travelled == pytest.approx(float(forward_displacement(truth.trajectory)[0]), abs=1e-12)


def test_an_unknown_robot_or_task_names_the_nearest():
    with pytest.raises(InputError, match="unknown robot 'quadrupd': did you mean quadruped"):
        tasks.load("quadrupd", "walk")
    with pytest.raises(InputError, match="unknown task of hexapod 'wlk': did you mean walk"):
        tasks.load("hexapod", "wlk")
