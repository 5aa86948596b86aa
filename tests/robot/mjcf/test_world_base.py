"""Tests of the settings of the base: an arm as its file is, robots on a stand, and freed robots."""

import mujoco
import numpy as np
import pytest

from selfmodel.errors import InputError
from selfmodel.robot.mjcf.settings import checked_settings
from selfmodel.robot.mjcf.world import STAND_CLEARANCE
from tests.helpers.robots.arms import PEDESTAL, arm, arm_mjcf, robot_of
from tests.robot.mjcf.awkward import BALL, GROUND, LEGS, mjcf

TWO_ARMS = '<body name="left" pos="0 1 0">{arm}</body><body name="table"><geom size=".1"/></body>'
HOME = '<keyframe><key name="home" qpos="0 0 .4 1 0 0 0 .2 -.2"/></keyframe>'


def touches_floor(model: mujoco.MjModel, qpos: np.ndarray) -> bool:
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    return bool((data.contact.geom == model.geom("floor").id).any())


def test_an_arm_directly_on_the_world_gets_a_base_and_moves_as_before():
    bare, given = robot_of(arm_mjcf("{arm}")), mujoco.MjModel.from_xml_string(arm_mjcf("{arm}"))
    assert bare.root == "base"
    states = []
    for model in (given, bare.model):
        data = mujoco.MjData(model)
        data.ctrl[:] = 0.5
        for _ in range(100):
            mujoco.mj_step(model, data)
        states.append(data.qpos.copy())
    assert np.array_equal(*states)


def test_an_arm_gets_no_ground():
    assert not (arm().model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE).any()


def test_two_arms_on_two_bodies_of_the_world_are_one_robot():
    second = arm_mjcf("{arm}").split("<worldbody>")[1].split("</worldbody>")[0]
    for kind in ("link", "joint"):
        second = second.replace(f'name="{kind}', f'name="other_{kind}')
    both = arm_mjcf(TWO_ARMS + f'<body name="right" pos="0 -1 0">{second}</body>')
    motor = '<motor name="other" joint="other_joint1" ctrlrange="-1 1"/></actuator>'
    robot = robot_of(both.replace("</actuator>", motor))
    assert robot.root == "base"
    parents = {robot.model.body(name).parentid[0] for name in ("left", "right")}
    assert parents == {robot.model.body("base").id}
    assert robot.model.body("table").parentid[0] == 0


def test_a_robot_on_a_stand_touches_no_ground_at_any_joint_angles():
    robot = robot_of(mjcf(world=GROUND), base="fixed")
    assert robot.has_fixed_base
    rng = np.random.default_rng(0)
    poses = rng.uniform(-np.pi, np.pi, (200, robot.model.nq))
    low = robot_of(mjcf(world=GROUND), base="fixed", base_height=0.25)
    assert any(touches_floor(low.model, pose) for pose in poses)
    assert not any(touches_floor(robot.model, pose) for pose in poses)


def test_the_stand_is_as_low_as_the_reach_of_the_robot_permits():
    robot = robot_of(mjcf(world=GROUND), base="fixed")
    # A hip at (0.1, 0, -0.1), a thigh of 0.2 about a capsule's end of 0.03.
    reach = np.hypot(0.1, 0.1) + 0.2 + 0.03
    assert robot.standing_height == pytest.approx(reach + STAND_CLEARANCE)


def test_a_stand_has_room_for_hinges_beside_the_origin_of_their_body():
    legs = LEGS.replace('name="left_hip"', 'name="left_hip" pos="0 0 .1"')
    high, low = (robot_of(mjcf(legs=text), base="fixed") for text in (legs, LEGS))
    assert high.standing_height - low.standing_height == pytest.approx(0.2)


def test_a_stand_is_above_the_top_of_other_ground():
    block = '<geom name="block" type="box" size="1 1 .1"/>'
    block, floor = (robot_of(mjcf(world=world), base="fixed") for world in (block, GROUND))
    assert block.standing_height - floor.standing_height == pytest.approx(0.1)


def test_the_height_of_a_stand_can_be_set():
    carried = '<body name="table" pos="0 0 .2"><geom size=".1"/>' + PEDESTAL + "</body>"
    for text in (mjcf(), arm_mjcf(), arm_mjcf(carried)):
        assert robot_of(text, base="fixed", base_height=2.5).standing_height == 2.5


def test_a_stand_holds_the_robot_in_the_pose_of_its_keyframe():
    robot = robot_of(mjcf(more=HOME), base="fixed")
    assert robot.model.qpos0.tolist() == pytest.approx([0.2, -0.2])


def test_hips_that_overlap_the_base_do_not_touch_it_when_it_is_fixed():
    torso = '<geom type="box" size=".2 .1 .1"/>'
    for root in ("<freejoint/>", '<joint type="slide" axis="1 0 0"/>'):
        model = robot_of(mjcf(torso=torso, root=root), base="fixed").model
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        assert data.ncon == 0


def test_a_planar_base_can_be_fixed():
    root = '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>'
    assert robot_of(mjcf(root=root), base="fixed").has_fixed_base


def test_a_fixed_robot_can_be_freed_with_its_keyframe():
    key = '<keyframe><key name="home" qpos=".2 -.2" qvel="0 0"/></keyframe>'
    robot = robot_of(mjcf(root="", more=key), base="free")
    assert not robot.has_fixed_base
    assert robot.model.qpos0.tolist() == pytest.approx([0, 0, 0.35, 1, 0, 0, 0, 0.2, -0.2])


def test_settings_that_name_the_base_of_the_file_change_nothing():
    for given, base in (({}, "free"), ({"root": ""}, "fixed")):
        assert robot_of(mjcf(**given), base=base).mjcf == robot_of(mjcf(**given)).mjcf, base


def test_an_arm_that_turns_on_the_world_cannot_be_freed():
    with pytest.raises(InputError, match="put the joints into one <body>"):
        robot_of(arm_mjcf("{arm}"), base="free")


def test_a_fixed_base_beside_a_ball_is_refused():
    with pytest.raises(InputError, match="one tree of moving bodies"):
        robot_of(mjcf(root="", world=GROUND + BALL))


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"base": "hanging"}, "one of free, fixed, got 'hanging'"),
        ({"base": "fixed", "base_height": "high"}, "got 'high'"),
        ({"base_height": 1.0}, 'base = "fixed", got 1.0 with base of the file'),
    ],
)
def test_wrong_settings_of_the_base_are_refused(given: dict[str, object], sentence: str):
    with pytest.raises(InputError, match=sentence):
        checked_settings(given)
