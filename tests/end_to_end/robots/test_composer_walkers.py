"""Walkers of dm_control.composer, as their library exports them, are robots with a free base."""

import importlib
from pathlib import Path

import mujoco
import pytest

from selfmodel.faults.hypothesis import INTACT
from selfmodel.robot.mjcf.load import load_mjcf
from selfmodel.robot.mjcf.settings import MjcfSettings
from selfmodel.robot.robot import Robot
from tests.helpers.drivers import random_controllers
from tests.helpers.exactness import exactness

pytestmark = pytest.mark.bodies


def exported(
    folder: Path, name: str, monkeypatch: pytest.MonkeyPatch, *, upright: bool = False
) -> Robot:
    """Returns the robot of a walker of dm_control.locomotion."""
    monkeypatch.setenv("MUJOCO_GL", "disable")  # without an OpenGL library
    walkers = importlib.import_module("dm_control.locomotion.walkers")
    mjcf = importlib.import_module("dm_control.mjcf")
    walker = getattr(walkers, name)()
    if upright:
        walker.root_body.quat = walker.upright_pose.xquat
    mjcf.export_with_assets(walker.mjcf_model, str(folder), "walker.xml")
    return load_mjcf(folder / "walker.xml", MjcfSettings(base="free"))


@pytest.mark.parametrize("name", ["Ant", "CMUHumanoidPositionControlledV2020"])
def test_a_freed_walker_is_a_robot_whose_predictions_are_exact(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    robot = exported(tmp_path, name, monkeypatch)
    (driver,) = random_controllers(robot, 1)

    found = exactness(robot, INTACT, driver, steps=40)

    assert not robot.has_fixed_base
    assert robot.model.jnt_type[0] == mujoco.mjtJoint.mjJNT_FREE
    assert (found.prediction, found.displacement) == (0, 0)


def test_a_humanoid_in_the_upright_pose_of_its_walker_stands_on_its_legs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    name = "CMUHumanoidPositionControlledV2020"
    robot = exported(tmp_path, name, monkeypatch, upright=True)
    data = mujoco.MjData(robot.model)
    mujoco.mj_kinematics(robot.model, data)

    assert data.body("head").xpos[2] > data.body("root").xpos[2] + 0.3
    assert data.body("lfoot").xpos[2] < data.body("root").xpos[2] - 0.5
