"""Checks that a compiled model can be a robot; errors contain the name of the unsuitable part."""

import mujoco
import numpy as np

from selfmodel.errors import InputError
from selfmodel.robot.actuators import motor_joints
from selfmodel.robot.anatomy_reader import driven_joints, find_root_body, joints_of_body
from selfmodel.robot.model_checks import check_model
from selfmodel.robot.mujoco_errors import loading_a_model

_PROBE_SECONDS = 0.2
_MAX_PROBE_STEPS = 200
_MAX_LISTED_NAMES = 12


def check_usable(model: mujoco.MjModel) -> None:
    """Checks that a model can be simulated, driven, logged and diagnosed.

    Raises:
        InputError: The model cannot be a robot; the message has the reason and the part.
    """
    if not model.opt.timestep > 0 or not np.isfinite(model.opt.timestep):
        raise InputError(
            f"the model's <option timestep> must be above 0 s, got {model.opt.timestep}"
        )
    if not model.nu:
        raise InputError(
            "the model has no actuators: give each joint that a motor is to drive an element in "
            "<actuator>"
        )
    _check_one_tree(model)
    driven = driven_joints(model)
    if not driven:
        raise InputError(
            "the model's motors drive no joint, so no fault could be diagnosed: give the joints of "
            "its limbs motors in <actuator>"
        )
    try:
        root = find_root_body(model, driven)
        check_model(model, root)
    except ValueError as error:
        raise InputError(str(error)) from error
    _check_passive_base(model, root)
    _check_stable(model)


def _check_one_tree(model: mujoco.MjModel) -> None:
    """Checks that all moving bodies belong to one tree: a log contains the state of one robot."""
    roots = {int(model.body_rootid[body]) for body in model.jnt_bodyid}
    if len(roots) > 1:
        raise InputError(
            f"expected one tree of moving bodies, got {_listed(model, sorted(roots))}: keep the "
            f"robot, and remove the other bodies or fix them to the world"
        )


def _check_passive_base(model: mujoco.MjModel, root: int) -> None:
    base_joints = joints_of_body(model, root)
    for motor in range(model.nu):
        for joint in motor_joints(model, motor).intersection(base_joints):
            raise InputError(
                f"the motor {model.actuator(motor).name} drives {model.joint(joint).name} of the "
                f"root body {model.body(root).name}, which only the limbs may move: remove the "
                f"motor"
            )


def _check_stable(model: mujoco.MjModel) -> None:
    """Checks that a short simulation without commands does not diverge."""
    steps = min(_MAX_PROBE_STEPS, max(1, round(_PROBE_SECONDS / model.opt.timestep)))
    with loading_a_model():
        data = mujoco.MjData(model)
        for _ in range(steps):
            mujoco.mj_step(model, data)
    unstable = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL)
    if any(data.warning[w].number for w in (*unstable, mujoco.mjtWarning.mjWARN_BADQACC)):
        raise InputError(
            f"the simulation diverges within {steps * model.opt.timestep:.2g} s, without "
            f"commands: give the model a smaller <option timestep>, or realistic masses and joints"
        )


def _listed(model: mujoco.MjModel, bodies: list[int]) -> str:
    names = [model.body(body).name for body in bodies[:_MAX_LISTED_NAMES]]
    return ", ".join(names) + (" and others" if len(bodies) > _MAX_LISTED_NAMES else "")
