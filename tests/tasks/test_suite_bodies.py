"""Tests of the suite's bodies: time steps, environments and rewards are the suite's to the bit."""

import numpy as np
import pytest
from dm_control import suite

from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.physical.interface import TimedRobot
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.simulation.simulator import Simulator
from selfmodel.tasks import entry, suite_bodies
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trajectory import Trajectory, collect
from tests.helpers.drivers import random_controllers

STEPS = 60
FIRST = [
    pytest.param(*(domain, tasks[0]), marks=() if domain == "walker" else pytest.mark.bodies)
    for domain, tasks in suite_bodies.DOMAINS.items()
]
TOUCHING = ("dog",)
"""Domains whose reward depends on contact forces, which are those of another physics step."""


@pytest.mark.parametrize(("domain", "task"), FIRST)
def test_the_simulated_return_is_that_of_the_suites_own_environment(domain: str, task: str):
    own = entry(suite_bodies.name(domain, task))
    robot, score = own.robot(), own.episode_return
    assert score is not None
    driver = random_controllers(robot, 1)[0]
    simulated = Simulator(robot, 1).run([(INTACT, driver)], STEPS, score.record).trajectory
    # The suite's own model and task, with the model's initial pose instead of a random one.
    env = suite.load(domain, task, task_kwargs={"random": 0})
    targets = env.physics.model.geom_pos.copy()
    env.reset()
    env.physics.model.geom_pos[:] = targets
    with env.physics.reset_context():
        env.physics.data.qpos[:] = robot.model.qpos0
    earned = sum(env.step(command).reward for command in simulated["commands"][0, :-1])

    exact = 1e-9 if domain not in TOUCHING else 0.01
    assert earned == pytest.approx(score.of(robot, INTACT, simulated)[0], rel=exact)
    assert earned != 0 or domain == "hopper"
    turned = np.flatnonzero(robot.model.qpos0 != env.physics.model.qpos0)
    assert turned.tolist() == ([2] if domain == "swimmer" else [])


@pytest.mark.parametrize(
    ("name", "case"),
    [("suite-walker-walk", 1), ("suite-quadruped-walk", 3), ("suite-hopper-hop", 10)],
)
def test_the_environment_of_a_damaged_body_is_its_simulation_to_the_bit(name: str, case: int):
    own = entry(name)
    robot, score = own.robot(), own.episode_return
    truth = parse(own.cases[case], robot.anatomy)
    driver = random_controllers(robot, 1)[0]
    assert own.physical is not None
    assert score is not None
    physical = own.physical(robot, truth)
    expected = collect(robot.anatomy.names, SimulatedRobot(robot, truth).run(driver, STEPS))
    for _ in range(2):  # every episode has the same initial pose
        got = collect(robot.anatomy.names, physical.run(driver, STEPS))
        for signal in SIGNALS:
            assert got[signal].tobytes() == expected[signal].tobytes(), signal

    assert isinstance(physical, TimedRobot)
    assert got.late is not None
    assert not got.late.any()
    batch = {signal: got[signal][np.newaxis] for signal in score.record}
    worth = score.of(robot, truth, Trajectory(got.names, got.time, batch))
    assert physical.env.task.returns == pytest.approx([worth[0]] * 2, rel=1e-9)


@pytest.mark.parametrize(("domain", "task"), FIRST)
def test_time_steps_and_episodes_are_the_suites(domain: str, task: str):
    own = entry(suite_bodies.name(domain, task))
    robot, env = own.robot(), suite.load(domain, task)

    assert robot.control_timestep == pytest.approx(env.control_timestep(), rel=1e-12)
    assert float(robot.model.opt.timestep) == env.physics.timestep()
    assert env.action_spec().shape == (len(robot.anatomy.motors),)
    assert own.episode_return is not None
    assert round(env._step_limit) == own.episode_return.episode == own.episode_return.most(1001)


@pytest.mark.parametrize(
    ("name", "nearest"),
    [
        ("suite-walker-fly", "suite-walker-"),
        ("suite-walker", "suite-walker-"),
        ("walker", "suite-walker-"),
        ("suite-walke-run", "did you mean suite-walker-run"),
        ("hexapd", "did you mean hexapod"),
    ],
)
def test_a_robot_that_there_is_not_is_refused_with_the_nearest(name: str, nearest: str):
    with pytest.raises(InputError, match=nearest):
        entry(name)
