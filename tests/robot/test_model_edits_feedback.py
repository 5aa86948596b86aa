"""Tests of servos that measure a wrong angle."""

import mujoco
import numpy as np
import pytest

from selfmodel.robot.model_edits import shift_feedback

OFFSET = 0.2
KP = 30.0

MJCF = """
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
    model = mujoco.MjModel.from_xml_string(MJCF.format(motor=motor))
    angles = {"hip": 0.15, "knee": -0.4}
    measured = {**angles, hinge: angles[hinge] + OFFSET}
    expected = force(model, **measured)
    before = force(model, **angles)

    shift_feedback(model, hinge, OFFSET)

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
    model = mujoco.MjModel.from_xml_string(MJCF.format(motor=motor))
    before = force(model, 0.15, -0.4)

    shift_feedback(model, "hip", OFFSET)

    assert force(model, 0.15, -0.4) == before


def test_offsets_of_the_hinges_of_one_tendon_add_up():
    motor = f'<position tendon="both" kp="{KP}"/>'
    model = mujoco.MjModel.from_xml_string(MJCF.format(motor=motor))

    shift_feedback(model, "hip", OFFSET)
    shift_feedback(model, "knee", OFFSET)

    np.testing.assert_allclose(model.actuator_biasprm[0, 0], -KP * (0.5 - 2) * OFFSET)
