"""Tests of visual meshes without files: the motion is the same, and the bodies are drawn."""

from pathlib import Path

import mujoco
import numpy as np

from selfmodel.faults.hypothesis import INTACT
from selfmodel.robot.mjcf.load import adapt, load_mjcf
from selfmodel.robot.mjcf.settings import MjcfSettings
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.signals import SIGNALS
from tests.helpers.drivers import random_controllers
from tests.helpers.robots.menagerie import menagerie


def motion(robot: Robot) -> np.ndarray:
    """Returns the base's path under a random controller, ``(steps, 3)``, m."""
    (controller,) = random_controllers(robot, 1, seed=2)
    found = Simulator(robot, 1).run([(INTACT, controller)], 60, SIGNALS)
    return found.behaviour["base_position"][0]


def test_a_robot_without_the_files_of_its_visual_meshes_moves_the_same(tmp_path: Path):
    file = menagerie(tmp_path) / "xml" / "scene.xml"
    whole = load_mjcf(file)

    for mesh in (tmp_path / "go" / "meshes").iterdir():
        mesh.unlink()
    bare = load_mjcf(file)

    assert np.array_equal(motion(whole), motion(bare))
    notes = adapt(file, MjcfSettings()).notes
    assert any("3 visual meshes have no file" in note for note in notes)


def test_each_body_is_drawn_as_the_box_of_its_inertia(tmp_path: Path):
    file = menagerie(tmp_path) / "xml" / "scene.xml"
    (tmp_path / "go" / "meshes" / "trunk.stl").unlink()

    model = load_mjcf(file).model
    trunk = model.body("trunk")
    boxes = [
        geom
        for geom in range(int(trunk.geomadr[0]), int(trunk.geomadr[0] + trunk.geomnum[0]))
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_BOX and model.geom_group[geom] == 2
    ]

    assert len(boxes) == 1
    x, y, z = 2 * model.geom_size[boxes[0]]
    inertia = trunk.mass[0] / 12 * np.array([y * y + z * z, x * x + z * z, x * x + y * y])
    assert np.allclose(inertia, trunk.inertia)
    assert not model.geom_contype[boxes[0]]
