"""Tests of dry friction in joints."""

import copy

import mujoco
import numpy as np
import pytest

from selfmodel.faults.build import build
from selfmodel.faults.notation import parse
from selfmodel.robot.robot import Robot


def built(robot: Robot, text: str) -> mujoco.MjModel:
    return build(robot, parse(text, robot.anatomy)).model


def test_joint_friction_is_that_part_of_the_largest_torque_of_one_joint(quadruped: Robot):
    stiff = built(quadruped, "joint-friction:front_left_knee=0.25")

    friction = np.zeros(quadruped.model.nv)
    friction[quadruped.model.joint("front_left_knee").dofadr[0]] = 0.25 * 12
    assert stiff.dof_frictionloss == pytest.approx(friction)


def test_a_joint_moves_only_above_its_friction(quadruped: Robot):
    # At 0.03 rad the servo has 1.8 N m, at 0.3 rad its limit of 12 N m; the friction is 3 N m.
    stiff, angles = built(quadruped, "joint-friction:front_left_knee=0.25"), {}
    for target in (0.03, 0.3):
        for name, model in (("stiff", stiff), ("healthy", copy.copy(quadruped.model))):
            model.opt.gravity[:] = 0.0
            data = mujoco.MjData(model)
            data.actuator("front_left_knee").ctrl = target
            mujoco.mj_step(model, data, 40)
            angles[name, target] = float(data.joint("front_left_knee").qpos[0])

    # MuJoCo's dry friction creeps.
    assert angles["stiff", 0.03] < 0.6 * angles["healthy", 0.03]
    assert angles["stiff", 0.3] > 0.7 * angles["healthy", 0.3]


def test_the_largest_torque_of_a_motor_without_a_limit_is_that_of_its_largest_command():
    robot = Robot(
        "geared",
        """<mujoco><option timestep="0.005"/><worldbody><geom type="plane" size="0 0 1"/>
        <body name="trunk" pos="0 0 0.5"><freejoint/><geom type="box" size="0.1 0.1 0.1"/>
          <body name="leg"><joint name="hip" axis="0 1 0" range="-60 60"/>
            <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02"/></body></body></worldbody>
        <actuator><motor name="hip" joint="hip" ctrlrange="-0.5 2" gear="-3"/></actuator>
        </mujoco>""",
        0.02,
    )

    assert built(robot, "joint-friction:hip=0.1").dof_frictionloss[-1] == pytest.approx(0.6)


@pytest.mark.parametrize("fault", ["break", "jam"])
def test_a_joint_that_cannot_move_has_no_friction(quadruped: Robot, fault: str):
    both = f"{fault}:front_left_knee+joint-friction:front_left_knee=0.4"

    assert str(parse(both, quadruped.anatomy)) == f"{fault}:front_left_knee"
