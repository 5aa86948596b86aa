"""What a model may have that selfmodel cannot diagnose: refused by name, never half done."""

import mujoco
import numpy as np

from selfmodel.errors import InputError
from selfmodel.robot.anatomy_reader import driven_joints
from selfmodel.robot.floating_base import find_root_body, joints_of_body
from selfmodel.robot.mjcf.mujoco_errors import told_by_mujoco
from selfmodel.robot.model_checks import check_model
from selfmodel.robot.transmission import motor_joints

_PROBE_SECONDS = 0.2
_MOST_PROBE_STEPS = 200
_LONGEST = 12
"""Names that a sentence lists."""


def refuse_unusable(model: mujoco.MjModel) -> None:
    """Refuses a model of which no robot can be made.

    Raises:
        InputError: The sentence says what is in the way, and where.
    """
    if not model.opt.timestep > 0 or not np.isfinite(model.opt.timestep):
        raise InputError(f"its <option timestep> must be above 0 s, got {model.opt.timestep}")
    _refuse_infinite(model)
    if not model.nu:
        raise InputError(
            "it has no actuators, and nothing to control: give each joint that a motor is to "
            "drive one in <actuator>"
        )
    _refuse_trees(model)
    driven = driven_joints(model)
    if not driven:
        raise InputError(
            "its motors drive no joint, and nothing of it could be diagnosed: give the joints of "
            "its limbs motors in <actuator>"
        )
    try:
        root = find_root_body(model, driven)
        check_model(model, root)
    except ValueError as error:
        raise InputError(str(error)) from error
    _refuse_driven_root(model, root)
    _refuse_unstable(model)


def _refuse_infinite(model: mujoco.MjModel) -> None:
    for name in ("body_mass", "body_inertia", "body_pos", "geom_size", "jnt_range", "qpos0"):
        if not np.isfinite(getattr(model, name)).all():
            raise InputError(f"its {name.replace('_', ' ')} has numbers that are not finite")


def _refuse_trees(model: mujoco.MjModel) -> None:
    """A robot is one tree; anything else that moves would be in no log."""
    roots = {int(model.body_rootid[body]) for body in model.jnt_bodyid}
    if len(roots) > 1:
        raise InputError(
            f"it has several things that move by themselves, {_listed(model, sorted(roots))}: keep "
            f"the robot, and take the others out or fix them to the world"
        )


def _refuse_driven_root(model: mujoco.MjModel, root: int) -> None:
    own = joints_of_body(model, root)
    for motor in range(model.nu):
        for joint in motor_joints(model, motor).intersection(own):
            raise InputError(
                f"its motor {model.actuator(motor).name} drives {model.joint(joint).name} of the "
                f"root body {model.body(root).name}, which moves only by what its limbs do: take "
                f"the motor out"
            )


def _refuse_unstable(model: mujoco.MjModel) -> None:
    """A model that blows up with its motors at rest tells nothing about a robot."""
    data = mujoco.MjData(model)
    steps = min(_MOST_PROBE_STEPS, max(1, round(_PROBE_SECONDS / model.opt.timestep)))
    with told_by_mujoco():
        for _ in range(steps):
            mujoco.mj_step(model, data)
    unstable = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL)
    if any(data.warning[w].number for w in (*unstable, mujoco.mjtWarning.mjWARN_BADQACC)):
        raise InputError(
            f"it blows up in simulation within {steps * model.opt.timestep:.2g} s, with its motors "
            f"at rest: give it a smaller <option timestep>, or masses and joints of sane size"
        )


def _listed(model: mujoco.MjModel, bodies: list[int]) -> str:
    names = [model.body(body).name for body in bodies[:_LONGEST]]
    return ", ".join(names) + (" and others" if len(bodies) > _LONGEST else "")
