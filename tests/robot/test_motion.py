"""Poses from observations; a missing one is the last before it."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra import numpy as arrays

from selfmodel.faults.hypothesis import INTACT
from selfmodel.robot.motion import POSE, Poses, poses_of
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import signal_fields
from selfmodel.simulation.simulator import Simulator
from selfmodel.tasks import ROBOTS
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.signals import Signal
from tests.helpers.drivers import random_controllers

STEPS = 12


def moved(robot: Robot) -> Behaviour:
    (controller,) = random_controllers(robot, 1)
    batch = Simulator(robot, 1).run([(INTACT, controller)], STEPS, POSE).behaviour
    return Behaviour(batch.names, batch.time, {signal: batch[signal][0] for signal in POSE})


def told(robot: Robot, poses: Poses, signal: Signal) -> np.ndarray:
    """A signal of the state that the poses make up."""
    state = {"qpos": poses.qpos, "qvel": np.zeros((len(poses.qpos), robot.model.nv))}
    return signal_fields(robot)[signal].reader(state.__getitem__)()


MOVED = moved(ROBOTS["quadruped"].robot())
HINGES = MOVED["joint_positions"].shape[1]


def unseen(behaviour: Behaviour, **masks: np.ndarray) -> Behaviour:
    """The same with NaN where a mask of a signal says so."""
    signals = {signal: np.array(behaviour[signal]) for signal in POSE}
    for signal, mask in masks.items():
        signals[signal][mask] = np.nan
    return Behaviour(behaviour.names, behaviour.time, signals)


def test_where_all_was_observed_the_model_stands_as_it_did(robot: Robot):
    behaviour = moved(robot)
    poses = poses_of(robot, robot.model, behaviour)

    assert (poses.missing, poses.held.any()) == ((), False)
    for signal in POSE:
        np.testing.assert_array_equal(told(robot, poses, signal), behaviour[signal])


@given(
    arrays.arrays(bool, (STEPS, HINGES), elements=st.booleans()),
    arrays.arrays(bool, STEPS, elements=st.booleans()),
)
def test_what_was_not_observed_is_held_marked_and_named(joints: np.ndarray, base: np.ndarray):
    robot = ROBOTS["quadruped"].robot()
    logged = unseen(MOVED, joint_positions=joints, base_position=base)
    poses = poses_of(robot, robot.model, logged)
    angles = told(robot, poses, "joint_positions")

    assert np.isfinite(poses.qpos).all()
    never = joints.all(axis=0)
    named = [name for name, absent in zip(MOVED.names.hinges, never, strict=True) if absent]
    assert list(poses.missing) == named + ["base_position"] * bool(base.all())
    partly = (joints & ~never).any(axis=1) | (base & (not base.all()))
    np.testing.assert_array_equal(poses.held, partly)
    for k in range(STEPS):
        for j in range(HINGES):
            seen = np.flatnonzero(~joints[: k + 1, j])
            later = np.flatnonzero(~joints[:, j])
            if len(later) == 0:
                assert angles[k, j] == 0
            else:
                source = seen[-1] if len(seen) else later[0]
                assert angles[k, j] == MOVED["joint_positions"][source, j]


def test_a_part_of_an_orientation_is_none():
    robot = ROBOTS["quadruped"].robot()
    mask = np.zeros((STEPS, 4), dtype=bool)
    mask[5, 2] = True
    poses = poses_of(robot, robot.model, unseen(MOVED, base_orientation=mask))

    assert np.flatnonzero(poses.held).tolist() == [5]
    np.testing.assert_array_equal(poses.qpos[5, 3:7], MOVED["base_orientation"][4])
    np.testing.assert_allclose(np.linalg.norm(poses.qpos[:, 3:7], axis=1), 1)


@pytest.mark.parametrize("signal", ["base_position", "base_orientation"])
def test_without_a_base_the_robot_stays_where_it_starts(robot: Robot, signal: str):
    behaviour = moved(robot)
    poses = poses_of(robot, robot.model, unseen(behaviour, **{signal: np.array([True] * STEPS)}))
    assert poses.missing == (signal,)
    assert not poses.held.any()
    start = np.tile(behaviour[signal][0], (STEPS, 1))
    np.testing.assert_array_equal(told(robot, poses, signal), start)


def test_a_robot_that_slides_and_turns_in_a_plane_stands_where_it_was_seen():
    mjcf = """<mujoco><option timestep="0.01"/><worldbody><geom type="plane" size="0 0 1"/>
      <body name="torso" pos="0 0 1.2">
        <joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
        <joint name="pitch" axis="0 1 0"/><geom size="0.1"/>
        <body name="leg"><joint name="hip" axis="0 1 0" range="-1 1" limited="true"/>
          <geom type="capsule" size="0.05" fromto="0 0 0 0 0 -0.5"/></body>
      </body></worldbody>
      <actuator><position name="hip" joint="hip" kp="5" ctrlrange="-1 1"/></actuator>
      <sensor><jointpos name="angle" joint="hip"/></sensor></mujoco>"""
    robot = Robot("walker", mjcf, 0.01)
    behaviour = moved(robot)
    poses = poses_of(robot, robot.model, behaviour)

    assert poses.missing == ()
    assert np.ptp(poses.qpos, axis=0).min() > 0
    for signal in POSE:
        np.testing.assert_allclose(told(robot, poses, signal), behaviour[signal], atol=1e-12)
