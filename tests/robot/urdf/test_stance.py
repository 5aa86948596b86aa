"""Tests of the initial pose of a robot from a URDF."""

import mujoco
import numpy as np
import pytest

from selfmodel.errors import InputError
from tests.robot.urdf.samples import BALL, WALKER, converted, elements, joint, link, urdf


def start(text: str, **settings: object) -> mujoco.MjData:
    """Returns the state in the initial pose."""
    model = mujoco.MjModel.from_xml_string(converted(text, **settings).text)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    return data


def lowest_foot(data: mujoco.MjData) -> float:
    return min(float(data.body(f"{side}_foot").xpos[2]) for side in ("left", "right")) - 0.03


def test_joints_are_at_the_angle_of_their_range_that_is_nearest_to_zero():
    data = start(WALKER)

    assert data.joint("left_hip").qpos[0] == 0
    assert data.joint("left_knee").qpos[0] == -0.5


def test_the_lowest_point_touches_the_ground_in_any_pose():
    for pose in ({}, {"*_hip": 0.7, "*_knee": -1.4}, {"left_*": -0.9}):
        assert lowest_foot(start(WALKER, pose=pose)) == pytest.approx(0, abs=1e-9)


def test_the_pose_of_the_settings_counts():
    data = start(WALKER, pose={"*_hip": 0.7, "left_hip": 0.2})

    assert data.joint("left_hip").qpos[0] == 0.2
    assert data.joint("right_hip").qpos[0] == 0.7


def test_an_angle_outside_the_range_is_refused():
    with pytest.raises(InputError, match=r"range of -2 to -0\.5 rad"):
        start(WALKER, pose={"left_knee": 0.3})


def test_bodies_that_overlap_in_the_initial_pose_never_touch_and_others_do():
    lump = link("lump", 0.1, '<collision><geometry><sphere radius="0.3"/></geometry></collision>')
    text = WALKER.replace(
        "</robot>", lump + joint("neck", "trunk", "lump", xyz="0 0 0.2") + "</robot>"
    )
    text = text.replace('<link name="left_thigh">', f'<link name="left_thigh">{BALL}')

    document = converted(text)
    data = start(text)

    excluded = document.root.findall("contact/exclude")
    assert [(e.get("body1"), e.get("body2")) for e in excluded] == [("left_thigh", "lump")]
    assert any("left_thigh and lump" in note for note in document.notes)
    assert data.ncon == 2  # the feet on the ground
    assert np.abs(data.qacc).max() < 1e3


def test_a_joint_that_mimics_another_follows_it_and_has_no_motor():
    finger = joint(
        "finger",
        "palm",
        "tip",
        low=-3,
        high=3,
        more='<mimic joint="thumb" multiplier="-2" offset="0.1"/>',
    )
    text = urdf(*map(link, ("palm", "nail", "tip")), joint("thumb", "palm", "nail"), finger)

    document = converted(text, base="fixed", pose={"thumb": 0.5})
    data = start(text, base="fixed", pose={"thumb": 0.5})

    assert data.joint("finger").qpos[0] == pytest.approx(-0.9)
    assert np.abs(data.efc_pos[data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY]).max() < 1e-9
    assert set(elements(document, "actuator/position")) == {"thumb"}


def test_a_joint_that_mimics_an_unknown_joint_is_refused():
    text = urdf(*map(link, "ab"), joint("j", "a", "b", more='<mimic joint="thumb"/>'))

    with pytest.raises(InputError, match="mimics 'thumb'"):
        converted(text, base="fixed")
