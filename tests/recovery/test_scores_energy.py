"""Promises of the score ``energy``: the work of the joints costs displacement."""

import numpy as np

from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.recovery.scores import ENERGY, UPRIGHT, WORK_WEIGHT, joint_work
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import Behaviour
from tests.helpers.drivers import random_controllers


def test_work_is_power_over_time_in_either_direction(quadruped: Robot):
    hinges = len(quadruped.anatomy.hinges)
    effort, velocity = np.zeros((1, 3, hinges)), np.ones((1, 3, hinges))
    effort[0, 0, 0], effort[0, 1, 1], effort[0, 2, 2] = 2.0, -3.0, np.nan
    names, time = quadruped.anatomy.names, np.arange(3) * quadruped.control_timestep
    run = Behaviour(names, time, {"joint_efforts": effort, "joint_velocities": velocity})
    np.testing.assert_allclose(joint_work(quadruped, run), [5 * quadruped.control_timestep])
    unknown = {"joint_efforts": np.full_like(effort, np.nan), "joint_velocities": velocity}
    assert np.isnan(joint_work(quadruped, Behaviour(names, time, unknown))).all()


def test_the_score_is_the_upright_displacement_less_the_work_over_the_weight(quadruped: Robot):
    drivers = random_controllers(quadruped, 4)
    lost = parse("break:front_left_shoulder", quadruped.anatomy)
    for hypothesis in (INTACT, lost):
        runs = [(hypothesis, driver) for driver in drivers]
        run = Simulator(quadruped, 1).run(runs, 100, ENERGY.record).behaviour
        spent = UPRIGHT.of(quadruped, hypothesis, run) - ENERGY.of(quadruped, hypothesis, run)
        weight = joint_work(quadruped, run) * WORK_WEIGHT / spent
        gravity = np.linalg.norm(quadruped.model.opt.gravity)
        masses = weight / gravity
        np.testing.assert_allclose(masses, masses[0])
        whole = quadruped.model.body_mass.sum()
        assert masses[0] < whole if hypothesis == lost else np.isclose(masses[0], whole)
