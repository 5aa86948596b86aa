"""The robots of a report: their shapes, and poses that are those of the log."""

import json
from typing import Any

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.report.scene import Motion, Shot, geometry_of, quantised, scene_of, simplified
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import Trial, TrialPlan
from tests.helpers.drivers import random_controllers
from tests.helpers.robots.arms import quadruped_on_a_stand

STEPS = 30


def decoded(packed: dict[str, Any]) -> np.ndarray:
    """The numbers of ``quantised``, ``(rows, columns)``, as the page decodes them."""
    low, span = np.array(packed["low"]), np.array(packed["span"])
    levels = np.frombuffer(packed["data"], "<u2").reshape(-1, len(low))
    return low + span * levels / 65535


def angle(hinge: dict[str, Any], parent: np.ndarray, body: np.ndarray) -> float:
    """The angle of a hinge, rad, of the quaternions w x y z of its two bodies."""
    rest, above, below = (
        Rotation.from_quat(one, scalar_first=True) for one in (hinge["rest"], parent, body)
    )
    turned = (rest.inv() * above.inv() * below).as_rotvec()
    return hinge["reference"] + float(turned @ np.array(hinge["axis"]))


def moved(robot: Robot) -> Trajectory:
    (controller,) = random_controllers(robot, 1)
    batch = Simulator(robot, 1).run([(INTACT, controller)], STEPS, SIGNALS).trajectory
    return Trajectory(batch.names, batch.time, {one: batch[one][0] for one in SIGNALS})


def shot(robot: Robot, trajectory: Trajectory, hypothesis: Hypothesis = INTACT) -> Shot:
    """A trial whose only simulation diverged, so that the measured motion alone is drawn."""
    (controller,) = random_controllers(robot, 1)
    trial = Trial(TrialPlan("a", "after", controller, STEPS, 0), robot.name, trajectory, "a.mcap")
    return Shot("a", trial, (Motion("best", hypothesis, trajectory, diverged=True),))


@pytest.mark.parametrize("place", ["free", "on a stand"])
def test_the_angles_of_a_motion_are_those_of_the_log(place: str, robot: Robot):
    robot = robot if place == "free" else quadruped_on_a_stand()
    trajectory = moved(robot)

    scene = scene_of(robot, [shot(robot, trajectory)])

    (drawn_shot,) = scene["shots"]
    (motion,) = drawn_shot["motions"]
    rotations = decoded(motion["rotation"]).reshape(STEPS, len(scene["bodies"]), 4)
    drawn = np.array(
        [
            [angle(hinge, one[hinge["parent"]], one[hinge["body"]]) for hinge in scene["turned"]]
            for one in rotations
        ]
    )
    logged = trajectory["joint_positions"]
    turned = [robot.anatomy.hinges.index(one["name"]) for one in scene["turned"]]
    assert turned
    assert np.abs(decoded(motion["angles"]) - logged).max() < 1e-4
    assert np.abs(drawn - logged[:, turned]).max() < 2e-4
    assert drawn_shot["time"] == trajectory.time.tolist()
    assert motion["travelled"] == trajectory["base_position"][:, 0].tolist()


def test_detached_and_jammed_bodies_of_the_hypothesis_are_named(quadruped: Robot):
    hypothesis = parse("break:front_left_knee+jam:back_right_shoulder", quadruped.anatomy)

    scene = scene_of(quadruped, [shot(quadruped, moved(quadruped), hypothesis)])

    (motion,) = scene["shots"][0]["motions"]
    assert [scene["bodies"][i] for i in motion["detached"]] == ["front_left_lower"]
    assert [scene["bodies"][i] for i in motion["jammed"]] == ["back_right_upper"]


def test_a_long_trial_loses_steps_but_neither_its_first_nor_its_last(quadruped: Robot):
    trajectory = moved(quadruped)

    scene = scene_of(quadruped, [shot(quadruped, trajectory)], most_poses=STEPS * 9 // 4)

    time = scene["shots"][0]["time"]
    assert len(time) <= STEPS // 4 + 2
    assert [time[0], time[-1]] == [trajectory.time[0], trajectory.time[-1]]


def test_every_body_of_the_robot_has_its_shapes_and_the_world_has_none(robot: Robot):
    geometry = geometry_of(robot)

    assert "world" not in geometry["bodies"]
    assert {shape["body"] for shape in geometry["shapes"]} == set(range(len(geometry["bodies"])))
    assert geometry["bodies"][geometry["root"]] == robot.root
    json.dumps(geometry, allow_nan=False, default=bytes.hex)
    boxes = np.flatnonzero(robot.model.geom_type == mujoco.mjtGeom.mjGEOM_BOX)
    sizes = [robot.model.geom_size[geom].tolist() for geom in boxes]
    assert [one["size"] for one in geometry["shapes"] if one["type"] == "box"] == sizes


def test_quantised_numbers_are_within_half_a_level_and_a_column_of_one_number_is_exact():
    values = np.random.default_rng(0).normal(size=(50, 4)) * [1e-3, 1.0, 1e3, 0.0] + 0.1

    error = np.abs(decoded(quantised(values)) - values)

    assert np.all(error <= np.ptp(values, axis=0) / 131070 * (1 + 1e-9))


def sphere(rings: int) -> tuple[np.ndarray, np.ndarray]:
    """A unit sphere of ``2 rings^2`` squares, each of two triangles."""
    polar, around = np.meshgrid(
        np.linspace(0, np.pi, rings + 1), np.linspace(0, 2 * np.pi, 2 * rings + 1), indexing="ij"
    )
    vertices = np.stack(
        [np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)], axis=-1
    )
    first = (np.arange(rings)[:, None] * (2 * rings + 1) + np.arange(2 * rings)).reshape(-1)
    below = first + 2 * rings + 1
    faces = [np.stack([first, below, below + 1], 1), np.stack([first, below + 1, first + 1], 1)]
    return vertices.reshape(-1, 3), np.concatenate(faces)


@pytest.mark.parametrize("most", [200, 3000, 100_000])
def test_a_large_mesh_has_at_most_the_triangles_and_about_its_surface(most: int):
    vertices, faces = simplified(*sphere(60), most)

    assert 0 < len(faces) <= most
    assert faces.max() < len(vertices)
    assert np.all(np.abs(np.linalg.norm(vertices, axis=1) - 1) < 0.15)
    assert (len(faces) == len(sphere(60)[1])) == (most == 100_000)
