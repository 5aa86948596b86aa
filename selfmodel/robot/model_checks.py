"""What a model may not have: what would be lost from logs, or cannot be started in mid-motion."""

import mujoco

from selfmodel.robot.floating_base import joints_of
from selfmodel.robot.transmission import TRANSMISSIONS

_HINGE = int(mujoco.mjtJoint.mjJNT_HINGE)
_REFUSED_JOINTS = {
    int(mujoco.mjtJoint.mjJNT_SLIDE): "slides",
    int(mujoco.mjtJoint.mjJNT_BALL): "is a ball joint",
}
DYNAMICS = tuple(
    int(kind)
    for kind in (
        mujoco.mjtDyn.mjDYN_NONE,
        mujoco.mjtDyn.mjDYN_INTEGRATOR,
        mujoco.mjtDyn.mjDYN_FILTER,
        mujoco.mjtDyn.mjDYN_FILTEREXACT,
    )
)
"""The activation dynamics that a robot's motors may have."""

_GAINS = (int(mujoco.mjtGain.mjGAIN_FIXED), int(mujoco.mjtGain.mjGAIN_AFFINE))
_BIASES = (int(mujoco.mjtBias.mjBIAS_NONE), int(mujoco.mjtBias.mjBIAS_AFFINE))


def check_model(model: mujoco.MjModel, root: int) -> None:
    """Checks that a robot of this model can be logged, damaged and predicted from its logs.

    Args:
        model: A compiled MJCF.
        root: The number of its root body.

    Raises:
        ValueError: It has something that cannot; the sentence names what.
    """
    own = joints_of(model, root)
    for j in range(model.njnt):
        kind = int(model.jnt_type[j])
        if j not in own and kind in _REFUSED_JOINTS:
            raise ValueError(
                f"the model's joint {_called(model.joint(j))} {_REFUSED_JOINTS[kind]}: beyond the "
                f"root, a robot's joints are hinges"
            )
    if model.nflex or model.nplugin:
        raise ValueError(
            "the model has soft bodies (flex) or plugins, whose state no log holds: a robot is of "
            "rigid bodies"
        )
    for m in range(model.nu):
        _check_motor(model, m)
    _check_names(model)


def _check_motor(model: mujoco.MjModel, motor: int) -> None:
    name = _called(model.actuator(motor))
    sited = int(model.actuator_trntype[motor]) == int(mujoco.mjtTrn.mjTRN_SITE)
    if int(model.actuator_trntype[motor]) not in TRANSMISSIONS or (
        sited and model.actuator_trnid[motor, 1] >= 0
    ):
        raise ValueError(
            f"the model's motor {name} has a transmission that is not known here: expected a "
            f"joint, a tendon, a body, or a site without a reference site"
        )
    if (
        int(model.actuator_dyntype[motor]) not in DYNAMICS
        or int(model.actuator_gaintype[motor]) not in _GAINS
        or int(model.actuator_biastype[motor]) not in _BIASES
        or model.actuator_actnum[motor] > 1
        or model.actuator_delay[motor] > 0
    ):
        raise ValueError(
            f"the model's motor {name} is a muscle, has a delay, or has dynamics of a kind that is "
            f"not known here: expected none, integrator, filter or filterexact"
        )


def _check_names(model: mujoco.MjModel) -> None:
    motors = [model.actuator(m) for m in range(model.nu)]
    hinges = [model.joint(j) for j in range(model.njnt) if model.jnt_type[j] == _HINGE]
    for what, parts in (("motor", motors), ("hinge", hinges)):
        for part in parts:
            if not part.name:
                raise ValueError(
                    f"the model's {what} number {int(part.id)} has no name: give it one, because "
                    f"logs and faults tell parts by their names"
                )


def _called(part: mujoco.MjModel) -> str:
    return repr(part.name) if part.name else f"number {int(part.id)}"
