"""Tests of the anatomy that is read from a model: names, ranges, and refused models."""

import mujoco
import numpy as np
import pytest

from selfmodel.faults.build import build
from selfmodel.faults.notation import parse
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.signals import SIGNALS
from tests.helpers.robots.bodies import BODIES, EVERY_BODY, swung

MJCF = """
<mujoco>
  <compiler angle="radian"/>
  {top}
  <worldbody>
    <body name="torso" pos="0 0 1">
      {root}
      <geom size=".1"/>
      <body name="upper">
        {upper}
        <geom size=".1"/>
        <body name="lower" pos="0 0 -.3">
          <joint name="knee"/>
          <geom size=".1"/>
          <site name="toe"/>
        </body>
      </body>
    </body>
    {other}
  </worldbody>
  {tendon}
  <actuator>{motor}<motor name="knee" joint="knee"/></actuator>
  <sensor>
    <touch name="touch" site="toe"/>
    <jointpos name="upper_angle" joint="first"/>
    <jointpos name="lower_angle" joint="knee"/>
  </sensor>
</mujoco>
"""
PARTS = {
    "top": "",
    "root": "<freejoint/>",
    "upper": '<joint name="first" axis="1 0 0" range=".2 1"/>',
    "other": "",
    "tendon": "",
    "motor": '<motor name="first" joint="first"/>',
}


def made(**parts: str) -> Robot:
    return Robot("made", MJCF.format(**(PARTS | parts)), 0.002)


def two_hinges(one: str, other: str) -> str:
    return f'<joint name="{one}" axis="1 0 0"/><joint name="{other}" axis="0 1 0"/>'


@pytest.mark.parametrize(
    ("upper", "motor", "name"),
    [
        (two_hinges("first_x", "first"), "first", "first"),
        (two_hinges("first", "second"), "first", "upper"),
        # What it would be called is another joint's name.
        (two_hinges("first", "knee_y"), "first", "upper"),
        ('<joint name="first" axis="1 0 0"/>', "first", "first"),
    ],
)
def test_a_joint_has_the_common_prefix_of_its_hinges_or_the_name_of_its_body(
    upper: str, motor: str, name: str
):
    joints = made(upper=upper, motor=f'<motor name="m" joint="{motor}"/>').anatomy.joints

    assert [joint.name for joint in joints] == [name, "knee"]
    assert len(joints[0].hinges) == upper.count("<joint")


def test_a_hinge_without_a_motor_belongs_to_the_joint_of_its_body():
    driven = made(upper=two_hinges("first", "second"), motor='<motor name="m" joint="second"/>')
    loose = made(motor="")

    assert driven.anatomy.joint("upper").hinges == ("first", "second")
    assert [joint.name for joint in loose.anatomy.joints] == ["knee"]
    assert loose.anatomy.hinges == ("first", "knee")


def test_joints_of_the_same_name_are_refused():
    """Two joints have the same prefix, and the body of one has the name of a third joint."""
    tails = "".join(
        f'<body name="{body}">{two_hinges(f"tail_{body}", f"tail{body}")}<geom size=".1"/></body>'
        for body in ("knee", "other")
    )
    motors = "".join(f'<motor name="m{b}" joint="tail_{b}"/>' for b in ("knee", "other"))
    mjcf = MJCF.format(**(PARTS | {"motor": motors}))

    with pytest.raises(ValueError, match="two joints with the name 'knee'"):
        Robot("made", mjcf.replace('<body name="upper">', f'{tails}<body name="upper">'), 0.002)


@pytest.mark.parametrize("name", EVERY_BODY)
def test_a_controller_receives_the_reading_of_the_sensor_for_the_angle(name: str):
    robot = BODIES[name]()
    run = (
        Simulator(robot, 1)
        .run([(parse("intact", robot.anatomy), swung(robot, 5))], 5, SIGNALS)
        .trajectory
    )
    for column, sensor in enumerate(robot.anatomy.sensors):
        if sensor.kind == "angle":
            angles = run["joint_positions"][0, :, robot.anatomy.hinges.index(sensor.hinge)]
            np.testing.assert_allclose(
                run["sensors"][0, :, column], [sensor.reading(angle) for angle in angles]
            )


@pytest.mark.parametrize(
    ("parts", "sentence"),
    [
        ({"root": '<joint name="pole"/>'}, "put them into one <body>"),
        ({"root": '<joint name="s" type="slide"/><joint type="ball" name="b"/>'}, "base is fixed"),
        ({"root": '<joint name="h"/><joint name="s" type="slide"/>'}, "base is fixed"),
        (
            {
                "root": '<joint name="cart" type="slide" axis="1 0 0"/>',
                "motor": '<motor name="cart" joint="cart"/>',
            },
            "base is fixed",
        ),
        (
            {"other": '<body name="ball"><freejoint/><geom size=".1"/></body>'},
            "one root body that moves freely, got torso, ball",
        ),
        (
            {"upper": '<joint name="first"/><joint name="rail" type="slide"/>'},
            "'rail' is a slide joint",
        ),
        (
            {"other": '<body name="b"><joint name="bob" type="ball"/><geom size=".1"/></body>'},
            "'bob' is a ball joint",
        ),
        (
            {"motor": '<muscle name="strong" joint="first" lengthrange=".1 1"/>'},
            "'strong' is a muscle",
        ),
        (
            {"motor": '<general name="own" joint="first" dyntype="user"/>'},
            "'own' is a muscle, has a delay, or has dynamics",
        ),
        (
            {"motor": '<general name="own" joint="first" gaintype="user"/>'},
            "'own' is a muscle, has a delay, or has dynamics",
        ),
        ({"motor": '<motor name="m" site="toe" refsite="toe"/>'}, "'m' has a transmission"),
        ({"motor": '<motor joint="first"/>'}, "motor number 0 has no name"),
        ({"upper": '<joint axis="1 0 0"/><joint name="first"/>'}, "hinge number 1 has no name"),
    ],
)
def test_an_unsupported_part_is_refused_by_name_in_one_sentence(
    parts: dict[str, str], sentence: str
):
    mujoco.MjModel.from_xml_string(MJCF.format(**(PARTS | parts)))  # MuJoCo has no objection
    with pytest.raises(ValueError, match=sentence) as raised:
        made(**parts)

    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    "motor",
    [
        '<motor name="m" joint="first" gear="3"/>',
        '<motor name="m" jointinparent="first"/>',
        '<position name="m" joint="first" kp="3"/>',
        '<velocity name="m" joint="first" kv="3"/>',
        '<intvelocity name="m" joint="first" kp="3" actrange="-1 1"/>',
        '<cylinder name="m" joint="first" timeconst=".1"/>',
        '<motor name="m" site="toe" gear="0 0 1 0 0 0"/>',
        '<adhesion name="m" body="lower" ctrlrange="0 1"/>',
        '<general name="m" joint="first" dyntype="filterexact" dynprm=".1"/>',
    ],
)
def test_motors_of_these_kinds_drive_a_robot(motor: str):
    robot = made(motor=motor)
    lost = build(robot, parse("break:knee", robot.anatomy)).model

    assert robot.anatomy.motors == ("m", "knee")
    assert bool(lost.actuator("m").gainprm.any()) == ("first" in motor)
