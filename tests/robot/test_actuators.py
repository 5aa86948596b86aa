"""Tests of command ranges: read from a motor's attributes, or required in an error message."""

import pytest

from selfmodel.controllers.controller import TARGET_RANGE
from selfmodel.controllers.network import Network
from selfmodel.errors import InputError
from selfmodel.robot.actuators import command_ranges
from selfmodel.robot.designs import cpg_for, network_for
from selfmodel.robot.robot import Robot

MJCF = """
<mujoco>
  <compiler angle="radian" autolimits="true"/>
  <worldbody>
    <body name="base"><freejoint/><geom size=".1"/>
      <body name="leg">
        <joint name="hip" axis="0 1 0" {joint}/>
        <geom name="leg" type="capsule" fromto="0 0 0 0 0 -.2" size=".02"/>
        <site name="foot"/>
      </body>
    </body>
  </worldbody>
  <tendon><fixed name="cord" range="-.1 .3"><joint joint="hip" coef=".1"/></fixed></tendon>
  <actuator>{motor}</actuator>
  <sensor><jointpos name="angle" joint="hip"/></sensor>
</mujoco>
"""
LIMITED = 'range="-.5 .5"'


def made_with(motor: str, joint: str = LIMITED) -> Robot:
    return Robot("one-legged", MJCF.format(motor=motor, joint=joint), 0.01)


def test_the_own_robots_have_the_range_of_the_paper_to_the_bit(robot: Robot):
    paper = ((0.0, TARGET_RANGE),) * len(robot.anatomy.motors)

    assert command_ranges(robot.model) == paper
    assert network_for(robot) == Network(robot.anatomy.names.sensors, robot.anatomy.motors)
    assert cpg_for(robot).ranges == paper


@pytest.mark.parametrize(
    ("motor", "low", "high"),
    [
        # What the motor says of its control.
        ('<motor name="m" joint="hip" ctrlrange="-1 1" gear="50"/>', -1, 1),
        ('<motor name="m" joint="hip" ctrlrange="0 2"/>', 0, 2),
        ('<position name="m" joint="hip" kp="10" ctrlrange="-1.5 -.5"/>', -1.5, -0.5),
        ('<velocity name="m" joint="hip" kv="1" ctrlrange="-3 5"/>', -3, 5),
        # A position servo: where it holds the ends of the joint's range.
        ('<position name="m" joint="hip" kp="10"/>', -0.5, 0.5),
        ('<position name="m" joint="hip" kp="10" gear="2" forcerange="-3 3"/>', -1, 1),
        ('<position name="m" tendon="cord" kp="10"/>', -0.1, 0.3),
        (
            '<general name="m" joint="hip" biastype="affine" gainprm="20" biasprm="4 -10 -1"/>',
            -0.45,
            0.05,
        ),
        # A motor: where its force, or the torque at its joint, ends.
        ('<motor name="m" joint="hip" forcerange="-8 6"/>', -8, 6),
        ('<general name="m" joint="hip" gainprm="4" gear="9" forcerange="-8 6"/>', -2, 1.5),
        ('<velocity name="m" joint="hip" kv="2" forcerange="-8 6"/>', -4, 3),
    ],
)
def test_a_range_follows_from_the_attributes_of_the_motor(motor: str, low: float, high: float):
    ((centre, half),) = command_ranges(made_with(motor).model)

    assert (centre - half, centre + half) == pytest.approx((low, high))


def test_the_torque_limit_of_a_joint_bounds_a_motor_by_its_gear():
    joint = f'{LIMITED} actuatorfrcrange="-30 60"'
    ((centre, half),) = command_ranges(
        made_with('<motor name="m" joint="hip" gear="-3"/>', joint).model
    )

    assert (centre - half, centre + half) == pytest.approx((-20, 10))


@pytest.mark.parametrize(
    "motor",
    [
        '<motor name="m" joint="hip"/>',
        '<intvelocity name="m" joint="hip" kp="10" actrange="-1 1"/>',
        '<general name="m" joint="hip" gainprm="0" forcerange="-1 1"/>',
        '<motor name="m" site="foot"/>',
    ],
)
def test_a_motor_without_a_range_is_refused_by_name(motor: str):
    with pytest.raises(InputError, match=r"got none for the motor m: give it a ctrlrange"):
        command_ranges(made_with(motor).model)
