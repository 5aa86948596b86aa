"""Tests of feet that lost their grip."""

import mujoco
import numpy as np
import pytest

from selfmodel.faults.build import build
from selfmodel.faults.joints import LOST_GRIP
from selfmodel.faults.notation import parse
from selfmodel.robot.robot import Robot
from tests.faults.test_build import follow

FOOT = "front_left_knee"


def built(robot: Robot, text: str) -> mujoco.MjModel:
    return build(robot, parse(text, robot.anatomy)).model


def contacts(model: mujoco.MjModel) -> dict[str, mujoco.MjData]:
    """The parameters of the contact of each geom with the ground, in the initial pose, lowered."""
    data = mujoco.MjData(model)
    data.qpos[2] -= 0.02
    mujoco.mj_forward(model, data)
    assert data.ncon == 4
    return {
        model.geom(int(contact.geom[1])).name: (
            contact.friction.copy(),
            contact.solref.copy(),
            contact.solimp.copy(),
            contact.dim,
        )
        for contact in data.contact
    }


def test_one_foot_has_a_fraction_of_its_friction_and_nothing_else_changes(quadruped: Robot):
    slippery, nominal = contacts(built(quadruped, f"grip:{FOOT}=0.2")), contacts(quadruped.model)

    for geom, (friction, solref, solimp, dim) in nominal.items():
        factor = 0.2 if geom == "front_left_lower" else 1.0
        np.testing.assert_allclose(slippery[geom][0][:2], factor * friction[:2])
        np.testing.assert_array_equal(slippery[geom][0][2:], friction[2:])
        np.testing.assert_array_equal(slippery[geom][1], solref)
        np.testing.assert_allclose(slippery[geom][2], solimp)
        assert slippery[geom][3] == dim


def test_the_friction_of_the_ground_is_that_of_the_other_feet(quadruped: Robot):
    slippery = contacts(built(quadruped, f"friction=0.5+grip:{FOOT}=0.2"))

    frictions = {geom: parameters[0][0] for geom, parameters in slippery.items()}
    assert frictions.pop("front_left_lower") == pytest.approx(0.1)
    assert list(frictions.values()) == [0.5] * 3


def test_only_the_foot_without_grip_slides(quadruped: Robot):
    model = built(quadruped, f"grip:{FOOT}=0.01")
    model.opt.gravity[:] = [1.5, 0.0, -9.81]  # friction above 0.15 holds the robot
    paths = [follow(quadruped, each, 100)[quadruped.root] for each in (model, quadruped.model)]
    assert np.abs(paths[0][-1, :2] - paths[1][-1, :2]).max() > 1e-3

    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 100)  # settled
    feet = [data.site(f"{leg}_foot") for leg in ("front_left", "front_right", "back_left")]
    before = [foot.xpos.copy() for foot in feet]
    data.actuator(FOOT).ctrl = 0.3
    mujoco.mj_step(model, data, 200)
    slid = [np.linalg.norm((foot.xpos - old)[:2]) for foot, old in zip(feet, before, strict=True)]
    assert slid[0] > 3 * max(slid[1:])


def test_the_contact_parameters_are_those_of_the_mixed_geoms():
    mjcf = """<mujoco><worldbody>
      <geom name="ground" type="plane" size="0 0 1" solref="0.04 1" solmix="3" friction="0.4 0.1"
        solimp="0.8 0.9 0.01" condim="1"/>
      <body name="ball" pos="0 0 0.15"><freejoint/><geom name="trunk" size="0.05"/>
        <body name="leg"><joint name="hip" axis="0 1 0" range="-60 60"/>
          <geom name="foot" pos="0 0 -0.1" size="0.06" condim="4"/></body></body></worldbody>
      <actuator><position name="hip" joint="hip" ctrlrange="-1 1"/></actuator></mujoco>"""
    robot = Robot("ball", mjcf, 0.002)
    found = []
    for model in (robot.model, built(robot, "grip:hip=0.5")):
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        (contact,) = data.contact
        found.append((contact.solimp.copy(), contact.friction.copy()))
        assert contact.dim == 4
        np.testing.assert_allclose(contact.solref, [0.035, 1])
    (nominal_solimp, nominal_friction), (solimp, friction) = found
    np.testing.assert_allclose(solimp, nominal_solimp)
    np.testing.assert_allclose(friction[:2], 0.5 * nominal_friction[:2])
    np.testing.assert_array_equal(friction[2:], nominal_friction[2:])


def test_a_foot_is_the_last_joint_of_a_limb(robot: Robot):
    assert len(LOST_GRIP.parts(robot.anatomy)) == len(robot.anatomy.joints) // 2


def test_a_foot_that_is_gone_has_no_grip(quadruped: Robot):
    both = parse(f"break:front_left_shoulder+grip:{FOOT}=0.2", quadruped.anatomy)

    assert str(both) == "break:front_left_shoulder"
