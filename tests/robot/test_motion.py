"""Tests of drawn motion: poses from observations, and the geoms that are seen."""

import mujoco
import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra import numpy as arrays

from selfmodel.faults.hypothesis import INTACT
from selfmodel.robot.motion import (
    POSE,
    Poses,
    opacity,
    poses_of,
    stick_geoms,
    triangles_of,
    visible_geoms,
)
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import signal_fields
from selfmodel.simulation.simulator import Simulator
from selfmodel.tasks import ROBOTS
from selfmodel.trials.signals import Signal
from selfmodel.trials.trajectory import Trajectory
from tests.helpers.drivers import random_controllers

STEPS = 12


def moved(robot: Robot) -> Trajectory:
    (controller,) = random_controllers(robot, 1)
    return Simulator(robot, 1).run([(INTACT, controller)], STEPS, POSE).trajectory.run(0)


def told(robot: Robot, poses: Poses, signal: Signal) -> np.ndarray:
    """A signal of the state that the poses make up."""
    state = {"qpos": poses.qpos, "qvel": np.zeros((len(poses.qpos), robot.model.nv))}
    return signal_fields(robot)[signal](state.__getitem__)()


MOVED = moved(ROBOTS["quadruped"].robot())
HINGES = MOVED["joint_positions"].shape[1]


def unseen(trajectory: Trajectory, **masks: np.ndarray) -> Trajectory:
    """The same with NaN where a mask of a signal says so."""
    signals = {signal: np.array(trajectory[signal]) for signal in POSE}
    for signal, mask in masks.items():
        signals[signal][mask] = np.nan
    return Trajectory(trajectory.names, trajectory.time, signals)


def test_where_all_was_observed_the_model_stands_as_it_did(robot: Robot):
    trajectory = moved(robot)
    poses = poses_of(robot, robot.model, trajectory)

    assert (poses.missing, poses.held.any()) == ((), False)
    for signal in POSE:
        np.testing.assert_array_equal(told(robot, poses, signal), trajectory[signal])


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
    trajectory = moved(robot)
    poses = poses_of(robot, robot.model, unseen(trajectory, **{signal: np.array([True] * STEPS)}))
    assert poses.missing == (signal,)
    assert not poses.held.any()
    start = np.tile(trajectory[signal][0], (STEPS, 1))
    np.testing.assert_array_equal(told(robot, poses, signal), start)


MESH = '<asset><mesh name="m" vertex="-.1 0 0 .1 0 0 0 .1 0 0 0 .1"/></asset>'


def seen(geoms: str) -> list[bool]:
    """Returns which geoms of a body are drawn."""
    text = f"<mujoco>{MESH}<worldbody><body>{geoms}</body></worldbody></mujoco>"
    return visible_geoms(mujoco.MjModel.from_xml_string(text)).tolist()


VISUAL = '<geom type="mesh" mesh="m" contype="0" conaffinity="0" group="{}"/>'
COLLISION = '<geom type="capsule" size=".05 .1" group="{}"/>'


@pytest.mark.parametrize(
    ("geoms", "expected"),
    [
        (VISUAL.format(2) + COLLISION.format(3), [True, False]),
        (COLLISION.format(3), [True]),
        (COLLISION.format(5) * 2, [True, True]),
        (COLLISION.format(0) + VISUAL.format(1), [False, True]),
        (COLLISION.format(0) + VISUAL.format(0), [True, True]),
        (COLLISION.format(0) + COLLISION.format(3), [True, False]),
        ('<geom size=".01" group="1"/>' + COLLISION.format(3), [True, True]),
        ('<geom size=".1" rgba="1 1 1 0"/>', [True]),
        ('<geom size=".1" rgba="1 1 1 0"/><geom size=".1"/>', [False, True]),
    ],
)
def test_each_body_is_drawn_with_the_geoms_that_are_meant_to_be_seen(
    geoms: str, expected: list[bool]
):
    assert seen(geoms) == expected


def test_a_mesh_has_the_triangles_of_its_own_vertices():
    double = MESH.replace('"m"', '"n"').replace('"/>', ' 0 0 -.1"/>')
    model = mujoco.MjModel.from_xml_string(f"<mujoco>{MESH}{double}</mujoco>")

    for mesh in range(2):
        vertices, faces = triangles_of(model, mesh)
        assert (len(vertices), len(faces)) == (4 + mesh, 2 * (4 + mesh) - 4)
        assert np.unique(faces).tolist() == list(range(len(vertices)))


def test_a_ground_in_a_group_that_is_hidden_is_drawn():
    text = '<mujoco><worldbody><geom type="plane" size="0 0 1" group="4"/></worldbody></mujoco>'

    assert visible_geoms(mujoco.MjModel.from_xml_string(text)).tolist() == [True]


def test_a_stick_figure_has_the_box_of_a_mesh_only_where_a_body_has_nothing_else():
    text = f"""<mujoco>{MESH}<worldbody><body>{VISUAL.format(2)}{COLLISION.format(3)}</body>
    <body>{VISUAL.format(2)}</body></worldbody></mujoco>"""

    assert stick_geoms(mujoco.MjModel.from_xml_string(text)).tolist() == [False, True, True]


def test_the_opacity_of_a_geom_is_its_own_or_that_of_its_material():
    text = """<mujoco><asset><material name="glass" rgba="1 1 1 0.25"/></asset><worldbody>
    <geom size=".1" material="glass"/><geom size=".1" rgba="1 0 0 0.75"/><geom size=".1"/>
    <geom size=".1" material="glass" rgba="1 0 0 1"/></worldbody></mujoco>"""

    found = opacity(mujoco.MjModel.from_xml_string(text))

    assert np.allclose(found, [0.25, 0.75, 1, 1])
