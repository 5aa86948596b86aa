"""Position feedback of servos: the part of a motor's force that depends on a measured angle."""

import mujoco

from selfmodel.robot.anatomy.transmission import has_feedback, length_per_angle


def shift_feedback(model: mujoco.MjModel, name: str, offset: float) -> None:
    """Adds an offset to the angle of a hinge that the servos of its motors measure.

    The force of a motor with an affine bias is ``gain * command + bias[0] + bias[1] * length +
    bias[2] * velocity``. The offset adds ``length_per_angle * offset`` to the length, a constant
    force. A motor without position feedback, such as a torque motor, has a ``bias[1]`` of 0.

    Args:
        model: The model, edited in place.
        name: Name of the hinge.
        offset: Measured minus true angle, rad.
    """
    hinge = int(model.joint(name).id)
    for motor in range(model.nu):
        if has_feedback(model, motor):
            bias = model.actuator_biasprm[motor]
            bias[0] += bias[1] * length_per_angle(model, motor, hinge) * offset
