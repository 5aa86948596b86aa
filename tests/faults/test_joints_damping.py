"""Tests of damped joints."""

import mujoco
import numpy as np
import pytest

from selfmodel.faults.build import build
from selfmodel.faults.notation import parse
from selfmodel.robot.robot import Robot
from tests.faults.test_build import follow

UNDAMPED = Robot(
    "undamped",
    """<mujoco><option timestep="0.005"/><worldbody><geom type="plane" size="0 0 1"/>
    <body name="trunk" pos="0 0 0.5"><freejoint/><geom type="box" size="0.1 0.1 0.1"/>
      <body name="leg"><joint name="hip" axis="0 1 0" range="-60 60"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02"/></body></body></worldbody>
    <actuator><motor name="hip" joint="hip" ctrlrange="-1 1" gear="3"/></actuator></mujoco>""",
    0.02,
)


def built(robot: Robot, text: str) -> mujoco.MjModel:
    return build(robot, parse(text, robot.anatomy)).model


def test_a_damped_joint_moves_more_slowly_and_the_others_have_their_damping(robot: Robot):
    joint = robot.anatomy.joints[0]
    damped = built(robot, f"damping:{joint.name}=30")
    dofs = [robot.model.joint(hinge).dofadr[0] for hinge in joint.hinges]

    assert damped.dof_damping[dofs] == pytest.approx(30 * robot.model.dof_damping[dofs])
    others = np.setdiff1d(np.arange(robot.model.nv), dofs)
    np.testing.assert_array_equal(damped.dof_damping[others], robot.model.dof_damping[others])
    ways = [
        np.abs(np.diff(follow(robot, model, 100)[joint.hinges[0]])).sum()
        for model in (damped, robot.model)
    ]
    assert ways[0] < 0.7 * ways[1]


def test_a_joint_without_damping_in_the_model_is_damped_relative_to_its_inertia():
    damped = built(UNDAMPED, "damping:hip=4")

    assert damped.dof_damping[-1] == pytest.approx(3 * UNDAMPED.model.dof_M0[-1])
    assert str(parse("damping:hip=1", UNDAMPED.anatomy)) == "intact"


@pytest.mark.parametrize("fault", ["break", "jam"])
def test_a_joint_that_cannot_move_has_no_damping(quadruped: Robot, fault: str):
    both = f"{fault}:front_left_knee+damping:front_left_knee=8"

    assert str(parse(both, quadruped.anatomy)) == f"{fault}:front_left_knee"
