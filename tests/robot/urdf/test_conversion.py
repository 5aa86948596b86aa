"""Tests of robots from URDF files, loaded as a user does: they stand, and are refused clearly."""

import json
from pathlib import Path

import mujoco
import numpy as np
import pytest

from selfmodel.errors import InputError
from selfmodel.robot.mjcf.load import load_mjcf
from selfmodel.robot.robot import Robot
from tests.helpers.command import selfmodel
from tests.robot.urdf.samples import BALL, WALKER, joint, link, urdf, written

DEEP = "<robot>" + "<link>" * 5000 + "</link>" * 5000 + "</robot>"
BOMB = '<!DOCTYPE r [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]><robot name="&b;"/>'


def settled(robot: Robot, seconds: float = 2.0) -> mujoco.MjData:
    """Returns the state after some time with the commands of the initial pose."""
    data = mujoco.MjData(robot.model)
    for motor in range(robot.model.nu):
        data.ctrl[motor] = robot.model.qpos0[
            robot.model.jnt_qposadr[robot.model.actuator_trnid[motor, 0]]
        ]
    mujoco.mj_step(robot.model, data, round(seconds / robot.model.opt.timestep))
    return data


def test_a_urdf_gives_a_robot_with_touch_sensors_on_its_feet_that_stands(tmp_path: Path):
    robot = load_mjcf(written(tmp_path, toml='pose = {"*_hip" = 0.25, "*_knee" = -0.5}'))

    assert robot.name == "walker"
    assert robot.root == "trunk"
    assert robot.anatomy.hinges == ("left_hip", "left_knee", "right_hip", "right_knee")
    assert robot.anatomy.motors == robot.anatomy.hinges
    touch = [sensor.body for sensor in robot.anatomy.sensors if sensor.kind == "touch"]
    assert touch == ["left_foot", "right_foot"]
    assert robot.standing_height == pytest.approx(0.4 * np.cos(0.25) + 0.03)
    assert np.abs(settled(robot, 0.2).qvel).max() < 5


def test_a_urdf_on_the_link_world_has_a_fixed_base_unless_the_user_frees_it(tmp_path: Path):
    world = link("world", 0) + joint("mount", "world", "trunk", kind="fixed", xyz="0 0 1.5")
    text = WALKER.replace("</robot>", f"{world}</robot>")

    fixed = load_mjcf(written(tmp_path, text))
    free = load_mjcf(written(tmp_path, text, 'base = "free"'))

    assert fixed.model.nv == free.model.nv - 6 == 4
    assert settled(fixed).body("trunk").xpos[2] == 1.5


def test_base_fixed_fixes_the_root(tmp_path: Path):
    robot = load_mjcf(written(tmp_path, toml='base = "fixed"\nbase_height = 0.9'))

    assert robot.model.nv == 4
    assert settled(robot).body("trunk").xpos[2] == 0.9


def test_the_initial_pose_becomes_the_reference_pose_also_of_coupled_joints(tmp_path: Path):
    wing = link("wing", 0.1) + joint(
        "flap", "trunk", "wing", low=-3, high=3, more='<mimic joint="left_hip" offset="0.3"/>'
    )
    toml = 'pose = {left_hip = 0.5}\nbase = "fixed"'

    data = settled(
        load_mjcf(written(tmp_path, WALKER.replace("</robot>", f"{wing}</robot>"), toml))
    )

    assert data.joint("flap").qpos[0] == pytest.approx(
        data.joint("left_hip").qpos[0] + 0.3, abs=0.02
    )


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (BOMB, "<!DOCTYPE>"),
        (DEEP, "elements within each other"),
        (WALKER[:-20], "no XML"),
        (WALKER.replace("collision", "visual"), "no link has a <collision>"),
        (WALKER.replace('mass value="4.0"', 'mass value="1e300"'), "1 number in value"),
        (WALKER.replace('mass value="0.5"', 'mass value="-1"'), "mass of at least 0"),
        (WALKER.replace('radius="0.03"', 'radius="1e30"'), "1 number in radius"),
        (WALKER.replace('xyz="0 0.1 0"', 'xyz="nan 0 0"'), "numbers in xyz"),
        (WALKER.replace('effort="10.0"', 'effort="1e400"'), "1 number in effort"),
        (WALKER.replace('type="revolute"', 'type="fixed"'), "no actuators"),
        (urdf(link("a", 0), link("b", 0), joint("j", "a", "b")), "no link has a <collision>"),
        (
            urdf(link("a", 0, BALL), link("b"), joint("j", "a", "b")),
            "with a mass and moments above",
        ),
    ],
)
def test_a_hostile_or_unusable_urdf_is_refused_in_one_sentence(
    text: str, sentence: str, tmp_path: Path
):
    with pytest.raises(InputError) as refusal:
        load_mjcf(written(tmp_path, text))

    said = str(refusal.value)
    assert sentence in said
    assert said.startswith(str(tmp_path))
    assert "\n" not in said
    assert len(said) < 600


@pytest.mark.process
def test_thousands_of_links_are_refused_in_a_sentence(tmp_path: Path):
    names = [f"l{number}" for number in range(20_000)]
    parts = [link(name) for name in names]
    parts += [joint(f"j{name}", names[0], name) for name in names[1:]]

    with pytest.raises(InputError, match=r"walker\.urdf: "):
        load_mjcf(written(tmp_path, urdf(*parts)))


@pytest.mark.process
def test_every_command_with_a_robot_takes_a_urdf(tmp_path: Path):
    before = written(tmp_path, toml='pose = {"*_hip" = 0.25}\nreach = 0.3').read_bytes()
    robot = ("--robot", "walker.urdf")

    listed = selfmodel("robots", "walker.urdf", "--json", cwd=tmp_path)
    trial = selfmodel("trial", "walker.urdf", "--steps", "60", "--out", "t.mcap", cwd=tmp_path)
    done = [
        listed,
        trial,
        selfmodel("replay", "t.mcap", *robot, "--json", cwd=tmp_path),
        selfmodel("render", "t.mcap", *robot, "--out", "t.png", cwd=tmp_path),
        selfmodel("calibrate", "t.mcap", *robot, "--out", "c.xml", cwd=tmp_path),
    ]

    assert [one.returncode for one in done] == [0] * len(done), [one.stderr for one in done]
    found = json.loads(listed.stdout)
    assert found["robot"] == "walker"
    assert any("position servos" in note for note in found["notes"])
    assert json.loads(done[2].stdout)["rms"] is not None
    assert (tmp_path / "walker.urdf").read_bytes() == before
