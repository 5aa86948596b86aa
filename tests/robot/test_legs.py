"""Tests of the reach of limbs: which of them can be lowered to the ground."""

import math
from pathlib import Path

import pytest

from selfmodel.robot.anatomy import Joint
from selfmodel.robot.legs import reaches_ground
from selfmodel.robot.mjcf.load import load_mjcf
from selfmodel.robot.robot import Robot
from tests.robot.mjcf.awkward import LEGS, MOTORS, mjcf

EXTRA = """<body name="extra" pos="0 0 {height}"><joint name="pitch" axis="0 1 0" range="{range}"/>
<geom {shape}/></body>"""
EXTRA_MOTOR = MOTORS + '<motor name="extra_motor" joint="pitch" ctrlrange="-1 1"/>'
HALF = math.sqrt(0.5)
RIGID = 'type="capsule" size=".02" fromto="0 0 0 0 0 {length}"'


def with_extra(folder: Path, shape: str, height: float = 0.1, ends: str = "-170 170") -> Robot:
    """Returns a robot on two legs, 0.3 m below its torso, with another limb."""
    extra = EXTRA.format(height=height, range=ends, shape=shape)
    path = folder / "robot.xml"
    path.write_text(mjcf(legs=LEGS + extra, motors=EXTRA_MOTOR), encoding="utf-8")
    return load_mjcf(path)


def limb(robot: Robot, joint: str) -> list[Joint]:
    return [robot.anatomy.joint(joint)]


def test_a_leg_on_the_ground_reaches_it(tmp_path: Path):
    robot = with_extra(tmp_path, RIGID.format(length=0.1))

    assert reaches_ground(robot, limb(robot, "left_hip"))
    assert reaches_ground(robot, limb(robot, "right_hip"))


@pytest.mark.parametrize(
    ("length", "ends", "reaches"),
    [
        (0.2, "-170 170", False),  # too short
        (0.5, "-170 170", True),
        (0.5, "-30 30", False),  # an antenna that stays up
        (-0.5, "-30 30", True),
    ],
)
def test_a_raised_limb_is_lowered_over_the_range_of_its_joint(
    *, length: float, ends: str, reaches: bool, tmp_path: Path
):
    robot = with_extra(tmp_path, RIGID.format(length=length), ends=ends)

    assert reaches_ground(robot, limb(robot, "pitch")) == reaches


@pytest.mark.parametrize(
    "shape",
    [
        'type="sphere" size=".03" pos="0 0 -.4"',
        'type="capsule" size=".03 .2" pos="0 0 -.2"',
        'type="cylinder" size=".03 .22" pos="0 0 -.2"',
        'type="ellipsoid" size=".03 .03 .22" pos="0 0 -.2"',
        'type="box" size=".03 .03 .22" pos="0 0 -.2"',
    ],
)
@pytest.mark.parametrize(("height", "reaches"), [(0.09, True), (0.2, False)])
def test_the_lowest_point_is_that_of_the_shape(
    *, shape: str, height: float, reaches: bool, tmp_path: Path
):
    # The ends are 0.42 or 0.43 m below the joint, and the feet 0.33 m below the torso.
    robot = with_extra(tmp_path, shape, height, ends="-20 20")

    assert reaches_ground(robot, limb(robot, "pitch")) == reaches


@pytest.mark.parametrize(
    ("shape", "extent"),
    [
        ('type="capsule" size=".03 .1"', 0.03 + 0.1 * HALF),
        ('type="cylinder" size=".08 .1"', 0.18 * HALF),
        ('type="ellipsoid" size=".08 .03 .15"', 0.17 * HALF),
        ('type="box" size=".08 .03 .15"', 0.23 * HALF),
    ],
)
@pytest.mark.parametrize(("gap", "reaches"), [(0.014, True), (0.019, False)])
def test_a_tilted_shape_is_a_leg_if_it_ends_within_the_tolerance_of_the_ground(
    *, shape: str, extent: float, gap: float, reaches: bool, tmp_path: Path
):
    # The feet are 0.33 m below the torso, of which the tolerance is 0.0165 m.
    tilted = f'{shape} euler="0 45 0"'
    robot = with_extra(tmp_path, tilted, extent + gap - 0.33, ends="-.01 .01")

    assert reaches_ground(robot, limb(robot, "pitch")) == reaches


def test_the_hinges_of_a_leg_move_in_turns(tmp_path: Path):
    upper, lower = 'range="-90 90" axis="0 1 0"', 'range="-90 0" axis="0 1 0"'
    leg = f"""<body name="upper" pos="0 1 0"><joint name="shoulder" {upper}/>
    <geom type="capsule" size=".01" fromto="0 0 0 0 0 -1"/>
    <body name="lower" pos="0 0 -1" euler="0 90 0"><joint name="elbow" {lower}/>
    <geom type="capsule" size=".01" fromto="0 0 0 0 0 -1"/></body></body>"""
    motors = "".join(
        f'<motor name="{name}" joint="{name}" ctrlrange="-1 1"/>' for name in ("shoulder", "elbow")
    )
    path = tmp_path / "robot.xml"
    # Each hinge once: 0.71 m + 1 m; the shoulder again: 1.83 m.
    path.write_text(mjcf(torso='<geom size="1.87"/>', legs=leg, motors=motors), encoding="utf-8")
    robot = load_mjcf(path)

    assert reaches_ground(robot, [robot.anatomy.joint(name) for name in ("shoulder", "elbow")])


def test_a_limb_that_cannot_touch_the_ground_does_not_reach_it(tmp_path: Path):
    ghost = RIGID.format(length=0.5) + ' contype="0" conaffinity="0"'
    robot = with_extra(tmp_path, ghost)

    assert not reaches_ground(robot, limb(robot, "pitch"))


def test_no_limb_of_a_robot_without_contacts_reaches_the_ground(tmp_path: Path):
    path = tmp_path / "robot.xml"
    path.write_text(
        mjcf(more='<option density="1000"><flag contact="disable"/></option>'), encoding="utf-8"
    )
    robot = load_mjcf(path)

    assert not reaches_ground(robot, limb(robot, "left_hip"))


def test_the_initial_pose_of_the_robot_stays(tmp_path: Path):
    robot = with_extra(tmp_path, RIGID.format(length=0.5))
    pose = robot.model.qpos0.copy()
    reaches_ground(robot, limb(robot, "pitch"))

    assert (robot.model.qpos0 == pose).all()
