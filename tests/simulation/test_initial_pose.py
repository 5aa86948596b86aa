"""Promises of the start of a trial across a gap: near the reference pose, and out of the ground."""

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.spatial.transform import Rotation

from selfmodel.faults.build import build
from selfmodel.faults.notation import parse
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import signal_fields
from selfmodel.simulation.initial_pose import (
    ANGLE_DEVIATION,
    TILT_DEVIATION,
    randomize_initial_pose,
    start_spread,
)
from selfmodel.tasks import ROBOTS

QUADRUPED = ROBOTS["quadruped"].robot()


def started(
    robot: Robot, level: float, seed: int, text: str = "intact"
) -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = build(robot, parse(text, robot.anatomy)).model
    data = mujoco.MjData(model)
    randomize_initial_pose(robot, model, data, start_spread(level), np.random.default_rng(seed))
    mujoco.mj_forward(model, data)
    return model, data


def test_starts_spread_around_the_reference_pose(robot: Robot):
    level, draws = 0.1, 300
    where = signal_fields(robot)
    angles, turns, places_ = [], [], []
    for seed in range(draws):
        _, data = started(robot, level, seed)
        angles.append(data.qpos[where["joint_positions"].columns].copy())
        turns.append(data.qpos[where["base_orientation"].columns].copy())
        places_.append(data.qpos[:2].copy())

    np.testing.assert_allclose(np.std(angles, axis=0), level * ANGLE_DEVIATION, rtol=0.25)
    np.testing.assert_allclose(
        np.mean(angles, axis=0), 0, atol=5 * level * ANGLE_DEVIATION / draws**0.5
    )
    tilts = Rotation.from_quat(turns, scalar_first=True).as_rotvec()
    np.testing.assert_allclose(tilts[:, :2].std(axis=0), level * TILT_DEVIATION, rtol=0.25)
    np.testing.assert_allclose(tilts[:, 2], 0, atol=1e-9)
    np.testing.assert_array_equal(places_, np.zeros((draws, 2)))


@given(seed=st.integers(0, 2**32), level=st.floats(0, 0.5))
@settings(max_examples=60, deadline=None)
def test_no_start_is_deeper_in_the_ground_or_bent_further_than_the_robot_can_be(
    seed: int, level: float
):
    reference = mujoco.MjData(QUADRUPED.model)
    mujoco.mj_forward(QUADRUPED.model, reference)
    model, data = started(QUADRUPED, level, seed)

    assert data.contact.dist.min(initial=1) >= reference.contact.dist.min() - 1e-9
    for hinge in QUADRUPED.anatomy.hinges:
        low, high = model.joint(hinge).range
        assert low <= data.joint(hinge).qpos[0] <= high
    assert data.qpos[2] >= reference.qpos[2]
    assert not data.qvel.any()


def test_some_starts_had_to_be_lifted():
    heights = [started(QUADRUPED, 0.2, seed)[1].qpos[2] for seed in range(20)]

    assert max(heights) > QUADRUPED.standing_height + 0.005


@pytest.mark.parametrize("angle", [0.0, 0.3])
def test_a_held_joint_starts_where_it_is_held(robot: Robot, angle: float):
    joint = robot.anatomy.joints[0]
    _, data = started(robot, 0.5, 0, f"jam:{joint.name}={angle}")

    for hinge in joint.hinges:
        assert data.joint(hinge).qpos[0] == angle
