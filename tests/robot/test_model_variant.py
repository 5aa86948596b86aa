"""Tests of faults in models: couplings and feedback of broken, jammed and miscalibrated joints."""

import mujoco
import numpy as np
import pytest

from selfmodel.faults.build import build
from selfmodel.faults.notation import parse
from selfmodel.robot.anatomy import Anatomy
from selfmodel.robot.model_variant import ModelVariant
from selfmodel.robot.robot import Robot

MJCF = """
<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.002"/>
  <worldbody>
    <geom name="ground" type="plane" size="0 0 1" pos="0 0 -9"/>
    <body name="torso" pos="0 0 1">
      <freejoint/>
      <geom name="trunk" size=".2"/>
      <body name="upper" pos=".3 0 0">
        <joint name="hip" axis="0 1 0" range="-1 1" damping=".1"/>
        <geom size=".05"/>
        <site name="knob" pos="0 0 -.1"/>
        <body name="lower" pos=".3 0 0">
          <joint name="knee" axis="0 1 0" range="-1 1" damping=".1"/>
          <geom size=".05"/>
          <site name="cuff" pos="0 0 -.1"/>
          <body name="foot" pos=".3 0 0">
            <joint name="ankle" axis="0 1 0" range="-1 1" damping=".1"/>
            <geom name="toe" size=".05" contype="0" conaffinity="0"/>
            <site name="toe"/>
          </body>
        </body>
      </body>
      <body name="tail" pos="-.3 0 0">
        <joint name="tail" axis="0 1 0" range="-1 1" damping=".1"/>
        <geom size=".05"/>
      </body>
    </body>
  </worldbody>
  <tendon>
    <fixed name="whole"><joint joint="hip" coef="1"/><joint joint="ankle" coef="-1"/></fixed>
    <fixed name="lower" stiffness="5" damping="1" limited="true" range="-.1 .1" frictionloss=".1">
      <joint joint="knee" coef="1"/><joint joint="ankle" coef="1"/>
    </fixed>
    <spatial name="string" stiffness="9"><site site="knob"/><site site="cuff"/></spatial>
  </tendon>
  <equality>{equality}</equality>
  <contact><pair geom1="toe" geom2="trunk" margin="3"/></contact>
  <actuator>
    <motor name="hip" joint="hip" ctrlrange="-1 1"/>
    <motor name="whole" tendon="whole" ctrlrange="-1 1"/>
    <motor name="string" tendon="string" ctrlrange="-1 1"/>
    <motor name="tail" joint="tail" ctrlrange="-1 1"/>
  </actuator>
  <sensor><touch name="touch" site="toe"/></sensor>
</mujoco>
"""
JOINTED = '<joint joint1="ankle" joint2="hip" polycoef="0.1 0.5 0.3 0 0" solref="0.02 1"/>'
TENDONS = '<tendon tendon1="lower" polycoef="0 1 0 0 0"/>'
BODIES = '<connect body1="foot" body2="tail" anchor="0 0 0"/>'
SITES = '<weld site1="cuff" site2="knob"/>'


def made(*equality: str) -> Robot:
    return Robot("coupled", MJCF.format(equality="".join(equality)), 0.01)


def built(robot: Robot, text: str) -> mujoco.MjModel:
    return build(robot, parse(text, robot.anatomy)).model


def test_a_motor_moves_the_joints_of_its_tendon_and_belongs_to_the_first():
    joints = {joint.name: joint for joint in made().anatomy.joints}

    assert set(joints) == {"hip", "knee", "ankle", "tail"}
    assert joints["hip"].motors == ("hip", "whole")
    assert joints["knee"].motors == ("string",)  # which spans the knee alone
    assert joints["ankle"].motors == ()
    assert joints["hip"].motors_lost_if_jammed == {"hip"}
    assert joints["knee"].motors_lost_if_jammed == {"string"}
    assert joints["ankle"].motors_lost_if_broken == {"whole"}
    assert joints["knee"].motors_lost_if_broken == {"whole", "string"}


@pytest.mark.parametrize(
    ("text", "still", "slack"),
    [
        ("break:ankle", {"whole"}, {"lower"}),
        ("break:knee", {"whole", "string"}, {"lower", "string"}),
        ("break:tail", {"tail"}, set()),
        ("jam:knee", {"string"}, {"string"}),
        ("jam:ankle", set(), set()),
        ("jam:ankle+jam:hip", {"hip", "whole"}, set()),
        ("jam:ankle+jam:knee", {"string"}, {"lower", "string"}),
    ],
)
def test_motors_are_still_and_tendons_slack_if_a_body_is_lost_or_all_their_joints_are_welded(
    text: str, still: set[str], slack: set[str]
):
    model = built(made(), text)
    motors = {model.actuator(m).name for m in np.flatnonzero(~model.actuator_gainprm.any(axis=1))}
    tendons = {n for n in ("lower", "string") if not model.tendon_stiffness[model.tendon(n).id]}

    assert (motors, tendons) == (still, slack)
    lower = model.tendon("lower").id
    forces = (model.tendon_limited, model.tendon_damping, model.tendon_frictionloss)
    for force in forces:
        assert bool(force[lower]) == ("lower" not in slack)


@pytest.mark.parametrize("text", ["break:ankle", "break:knee", "break:hip", "break:tail"])
def test_a_constraint_is_disabled_if_one_of_its_bodies_is_detached(text: str):
    robot = made(JOINTED, TENDONS, BODIES, SITES)
    lost = robot.anatomy.joint(text.removeprefix("break:")).bodies
    involved = ({"foot", "upper"}, {"lower", "foot"}, {"foot", "tail"}, {"lower", "upper"})

    assert built(robot, text).eq_active0.tolist() == [not lost & bodies for bodies in involved]
    assert robot.model.eq_active0.all()


def test_a_constraint_of_welded_joints_only_is_disabled():
    robot = made(JOINTED, TENDONS)

    assert built(robot, "jam:ankle").eq_active0.tolist() == [1, 1]
    assert built(robot, "jam:ankle+jam:knee").eq_active0.tolist() == [1, 0]
    assert built(robot, "jam:ankle+jam:hip").eq_active0.tolist() == [0, 1]


def floating(equality: str) -> Robot:
    """Returns the robot with no forces but those of an equality constraint."""
    robot = made(equality)
    robot.model.opt.gravity[:] = 0
    robot.model.pair_margin[:] = 0
    for force in ("limited", "stiffness", "damping", "frictionloss"):
        getattr(robot.model, f"tendon_{force}")[:] = 0
    return robot


def settled(model: mujoco.MjModel) -> mujoco.MjData:
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 2000)
    return data


@pytest.mark.parametrize("angle", [-0.09, 0.3])
@pytest.mark.parametrize(("held", "other"), [("hip", "ankle"), ("ankle", "hip")])
def test_the_coupling_of_joints_is_the_same_if_one_of_them_is_welded(
    held: str, other: str, angle: float
):
    robot = floating(JOINTED)
    data = settled(built(robot, f"jam:{held}={angle}"))
    hip, ankle = (float(data.joint(name).qpos[0]) for name in ("hip", "ankle"))

    assert {"hip": hip, "ankle": ankle}[held] == pytest.approx(angle, abs=1e-5)
    assert ankle == pytest.approx(0.1 + 0.5 * hip + 0.3 * hip**2, abs=1e-3), other


@pytest.mark.parametrize(
    ("text", "contacts"), [("intact", 1), ("break:tail", 1), ("break:knee", 0)]
)
def test_a_detached_body_has_no_contacts_even_in_an_explicit_pair(text: str, contacts: int):
    model = built(made(), text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)

    assert np.count_nonzero(data.contact.efc_address >= 0) == contacts


def test_friction_of_an_explicit_pair_with_the_ground_is_that_of_sliding_alone():
    both = '<pair geom1="toe" geom2="ground" friction="1 1 .1 .2 .3"/></contact>'
    robot = Robot("paired", made().mjcf.replace("</contact>", both), 0.01)

    before, after = (built(robot, text).pair_friction for text in ("intact", "friction=0.4"))

    assert after[0].tolist() == [0.4, 0.4, 0.1, 0.2, 0.3]
    assert after[1].tolist() == before[1].tolist(), "of the robot with itself"


OFFSET = 0.2
KP = 30.0

HINGED = """
<mujoco>
  <worldbody>
    <body><joint name="hip" axis="0 1 0"/><geom size=".05"/>
      <site name="knob" pos="0 0 -.1"/>
      <body pos=".3 0 0"><joint name="knee" axis="0 1 0"/><geom size=".05"/>
        <site name="cuff" pos="0 0 -.1"/></body></body>
  </worldbody>
  <tendon>
    <fixed name="both"><joint joint="hip" coef="0.5"/><joint joint="knee" coef="-2"/></fixed>
    <spatial name="string"><site site="knob"/><site site="cuff"/></spatial>
  </tendon>
  <actuator>{motor}</actuator>
</mujoco>
"""


def force(model: mujoco.MjModel, hip: float, knee: float, command: float = 0.1) -> float:
    """The force of the motor at some angles, rad."""
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.ctrl[:] = (hip, knee), (0.3, -0.4), command
    mujoco.mj_forward(model, data)
    return float(data.actuator_force[0])


def shifted(model: mujoco.MjModel, hinge: str) -> mujoco.MjModel:
    variant = ModelVariant.of(model, Anatomy((), (), (), (), ""))
    variant.shift_feedback(hinge, OFFSET)
    return variant.model


@pytest.mark.parametrize("hinge", ["hip", "knee"])
@pytest.mark.parametrize(
    "motor",
    [
        f'<position joint="hip" kp="{KP}" kv="2"/>',
        f'<position joint="knee" kp="{KP}" gear="-3"/>',
        f'<position jointinparent="knee" kp="{KP}" gear="2"/>',
        f'<position tendon="both" kp="{KP}" gear="2"/>',
        '<general joint="hip" biastype="affine" gainprm="5" biasprm="4 -7 -1" gear="2"/>',
    ],
)
def test_a_servo_has_the_force_of_the_measured_angle_in_place_of_the_true_one(
    motor: str, hinge: str
):
    model = mujoco.MjModel.from_xml_string(HINGED.format(motor=motor))
    angles = {"hip": 0.15, "knee": -0.4}
    measured = {**angles, hinge: angles[hinge] + OFFSET}
    expected = force(model, **measured)
    before = force(model, **angles)

    model = shifted(model, hinge)

    assert force(model, **angles) == pytest.approx(expected, abs=1e-12)
    assert (expected != pytest.approx(before)) == ("both" in motor or hinge in motor)


@pytest.mark.parametrize(
    "motor",
    [
        '<motor joint="hip" gear="5"/>',
        '<velocity joint="hip" kv="5"/>',
        f'<position tendon="string" kp="{KP}"/>',
    ],
)
def test_a_motor_that_does_not_measure_the_hinge_is_not_affected(motor: str):
    model = mujoco.MjModel.from_xml_string(HINGED.format(motor=motor))
    before = force(model, 0.15, -0.4)

    model = shifted(model, "hip")

    assert force(model, 0.15, -0.4) == before
