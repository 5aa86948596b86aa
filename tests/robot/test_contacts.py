"""Tests of contacts by geometry: legs that reach the ground, and self-collision."""

import math
from itertools import combinations

import mujoco
import numpy as np
import pytest

from selfmodel.robot.anatomy import Joint
from selfmodel.robot.contacts import penetration_depths, reaches_ground
from selfmodel.robot.mjcf.load import load_mjcf
from selfmodel.robot.robot import Robot
from tests.helpers.robots.arms import robot_of
from tests.robot.mjcf.awkward import LEGS, MOTORS, mjcf
from tests.robot.mjcf.samples import SAMPLES

EXTRA = """<body name="extra" pos="0 0 {height}"><joint name="pitch" axis="0 1 0" range="{range}"/>
<geom {shape}/></body>"""
EXTRA_MOTOR = MOTORS + '<motor name="extra_motor" joint="pitch" ctrlrange="-1 1"/>'
HALF = math.sqrt(0.5)
RIGID = 'type="capsule" size=".02" fromto="0 0 0 0 0 {length}"'


def with_extra(shape: str, height: float = 0.1, ends: str = "-170 170") -> Robot:
    """Returns a robot on two legs, 0.3 m below its torso, with another limb."""
    extra = EXTRA.format(height=height, range=ends, shape=shape)
    return robot_of(mjcf(legs=LEGS + extra, motors=EXTRA_MOTOR))


def limb(robot: Robot, joint: str) -> list[Joint]:
    return [robot.anatomy.joint(joint)]


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
    *, length: float, ends: str, reaches: bool
):
    robot = with_extra(RIGID.format(length=length), ends=ends)

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
    *, shape: str, extent: float, gap: float, reaches: bool
):
    # The feet are 0.33 m below the torso, of which the tolerance is 0.0165 m.
    tilted = f'{shape} euler="0 45 0"'
    robot = with_extra(tilted, extent + gap - 0.33, ends="-.01 .01")

    assert reaches_ground(robot, limb(robot, "pitch")) == reaches


def test_the_hinges_of_a_leg_move_in_turns():
    upper, lower = 'range="-90 90" axis="0 1 0"', 'range="-90 0" axis="0 1 0"'
    leg = f"""<body name="upper" pos="0 1 0"><joint name="shoulder" {upper}/>
    <geom type="capsule" size=".01" fromto="0 0 0 0 0 -1"/>
    <body name="lower" pos="0 0 -1" euler="0 90 0"><joint name="elbow" {lower}/>
    <geom type="capsule" size=".01" fromto="0 0 0 0 0 -1"/></body></body>"""
    motors = "".join(
        f'<motor name="{name}" joint="{name}" ctrlrange="-1 1"/>' for name in ("shoulder", "elbow")
    )
    # Each hinge once: 0.71 m + 1 m; the shoulder again: 1.83 m.
    robot = robot_of(mjcf(torso='<geom size="1.87"/>', legs=leg, motors=motors))

    assert reaches_ground(robot, [robot.anatomy.joint(name) for name in ("shoulder", "elbow")])


def test_a_limb_that_cannot_touch_the_ground_does_not_reach_it():
    ghost = RIGID.format(length=0.5) + ' contype="0" conaffinity="0"'
    robot = with_extra(ghost)

    assert not reaches_ground(robot, limb(robot, "pitch"))


MODEL = """
<mujoco>
  <compiler angle="radian"/>
  <default>
    <geom type="sphere" size="0.1" mass="1" {masks}/>
    <joint range="-3.2 3.2"/>
  </default>
  <worldbody>
    <geom type="plane" size="1 1 1" contype="1" conaffinity="1"/>
    <body name="trunk" pos="0 0 1">
      {base}
      <geom name="trunk"/>
      <geom name="horn" pos="0.4 0 0"/>
      <body name="left">
        <joint name="left" axis="0 0 1"/>
        <geom name="left" pos="0 0.4 0"/>
        <body><geom name="pad" size="0.05" pos="0 0.4 0.1"/></body>
      </body>
      <body name="right">
        <joint name="right" axis="0 0 1"/>
        <geom name="right" pos="0 -0.4 0"/>
      </body>
      <body name="lid">
        <joint name="lid" axis="1 0 0"/>
        {lid}
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor name="left" joint="left" ctrlrange="-1 1"/>
    <motor name="right" joint="right" ctrlrange="-1 1"/>
    <motor name="lid" joint="lid" ctrlrange="-1 1"/>
  </actuator>
  {contact}
</mujoco>
"""
"""Balls around a trunk: left and right on a circle of 0.4 m, and a lid above."""

COLLIDING = 'contype="1" conaffinity="1"'
NEAR = 0.4 - np.pi
"""Angle by which left comes within 0.4 rad of right."""

GROUND_ONLY = 'contype="0" conaffinity="1"'


def made(
    masks: str = COLLIDING,
    base: str = "<freejoint/>",
    lid: str = '<geom name="lid" pos="0 0 0.4"/>',
    contact: str = "",
) -> Robot:
    text = MODEL.format(masks=masks, base=base, lid=lid, contact=contact)
    return Robot("spheres", text, 0.01)


def depths(robot: Robot, *poses: tuple[float, float, float]) -> list[float]:
    return penetration_depths(robot, np.array(poses)).round(6).tolist()


EXCLUDED = '<contact><exclude body1="left" body2="right"/></contact>'


@pytest.mark.parametrize(
    "robot",
    [
        made(),
        made(GROUND_ONLY),
        made('contype="0" conaffinity="0"'),  # its shape is that of all geoms
        made(contact=EXCLUDED),
        made(base=""),
    ],
    ids=["colliding", "touching the ground alone", "touching nothing", "excluded", "on a stand"],
)
def test_bodies_that_are_no_neighbours_penetrate_whether_or_not_the_model_simulates_it(
    robot: Robot,
):
    # The circle's chord of 0.4 rad is 0.8 sin(0.2), and both radii are 0.1.
    depth = round(0.2 - 0.8 * np.sin(0.2), 6)

    assert depths(robot, (0, 0, 0), (NEAR, 0, 0), (0, -NEAR, 0), (-1.5, 0, 0)) == [
        *(0, depth, depth, 0)
    ]


def test_a_body_may_penetrate_its_neighbour_and_what_is_fixed_to_it():
    assert depths(made(), (-np.pi / 2, 0, 0), (0, np.pi / 2, 0)) == [0, 0]


def test_bodies_that_penetrate_each_other_in_the_initial_pose_are_one_assembly():
    robot = made(lid='<geom name="lid" pos="0 0.4 0.15"/>')

    assert depths(robot, (0, 0, 0), (0, 0, -0.2)) == [0, 0]
    assert depths(robot, (0, 0, 2.8))[0] > 0.1, "right is none of it"


def test_a_body_that_was_lost_is_not_compared():
    robot, pose = made(), np.array([[NEAR, 0, 0]])
    lost = int(robot.model.body("right").id)

    assert penetration_depths(robot, pose) > 0.04
    assert penetration_depths(robot, pose, {lost}) == 0
    assert penetration_depths(robot, pose) > 0.04, "the shape is kept"


@pytest.mark.parametrize("name", ["gymnasium ant", "gymnasium humanoid"])
def test_depths_of_bodies_of_others_are_those_of_their_geoms_pair_by_pair(name: str):
    robot = load_mjcf(SAMPLES[name])
    # Beyond the limits of the joints, within which the ant does not touch itself.
    poses = np.random.default_rng(0).uniform(-3, 3, (40, len(robot.anatomy.hinges)))

    found, expected = penetration_depths(robot, poses), depths_by_pairs(robot, poses)

    assert (expected > 0).sum() > 20
    assert np.allclose(found, expected, rtol=0, atol=1e-9)


def depths_by_pairs(robot: Robot, poses: np.ndarray) -> np.ndarray:
    """Depths from the distance of each pair of geoms; all geoms of the robot have contacts."""
    model, data = robot.model, mujoco.MjData(robot.model)

    def distance(pair: tuple[int, int]) -> float:
        return mujoco.mj_geomDistance(model, data, *pair, 1.0, None)

    group = model.body_weldid[model.geom_bodyid]  # bodies without a joint are one with the parent
    above = model.body_weldid[model.body_parentid[group]]
    apart = [
        (one, other)
        for one, other in combinations(np.flatnonzero(model.geom_bodyid).tolist(), 2)
        if group[one] not in (group[other], above[other]) and group[other] != above[one]
    ]
    mujoco.mj_kinematics(model, data)
    assembled = {bodies_of(model, pair) for pair in apart if distance(pair) < 0}
    apart = [pair for pair in apart if bodies_of(model, pair) not in assembled]
    columns = [int(model.joint(hinge).qposadr[0]) for hinge in robot.anatomy.hinges]
    depths = []
    for pose in poses:
        data.qpos[columns] = pose
        mujoco.mj_kinematics(model, data)
        depths.append(max(0.0, *(-distance(pair) for pair in apart)))
    return np.array(depths)


def bodies_of(model: mujoco.MjModel, geoms: tuple[int, int]) -> frozenset[int]:
    return frozenset(model.geom_bodyid[list(geoms)].tolist())
