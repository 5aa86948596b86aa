"""Rejects models that cannot be simulated, or whose state a log does not record or restore."""

import mujoco
import numpy as np

from selfmodel.errors import InputError, listed
from selfmodel.robot.actuators import SUPPORTED_TRANSMISSIONS, motor_joints
from selfmodel.robot.anatomy_reader import driven_joints, find_root_body, joints_of_body
from selfmodel.robot.mujoco_errors import loading_a_model

_HINGE = int(mujoco.mjtJoint.mjJNT_HINGE)
_UNSUPPORTED_JOINTS = {
    int(mujoco.mjtJoint.mjJNT_SLIDE): "is a slide joint",
    int(mujoco.mjtJoint.mjJNT_BALL): "is a ball joint",
}
_SUPPORTED_DYNAMICS = tuple(
    int(kind)
    for kind in (
        mujoco.mjtDyn.mjDYN_NONE,
        mujoco.mjtDyn.mjDYN_INTEGRATOR,
        mujoco.mjtDyn.mjDYN_FILTER,
        mujoco.mjtDyn.mjDYN_FILTEREXACT,
    )
)
_SUPPORTED_GAINS = (int(mujoco.mjtGain.mjGAIN_FIXED), int(mujoco.mjtGain.mjGAIN_AFFINE))
_SUPPORTED_BIASES = (int(mujoco.mjtBias.mjBIAS_NONE), int(mujoco.mjtBias.mjBIAS_AFFINE))

MAX_NUMBER = float(mujoco.mjMAXVAL)
"""Largest number of a model: MuJoCo resets a simulation whose state or acceleration exceeds it."""

_OPTIONS = ("timestep", "gravity", "wind", "magnetic", "density", "viscosity")
_NUMBERS = (
    *("qpos0", "body_pos", "body_quat", "body_ipos", "body_mass", "body_inertia"),
    *("geom_pos", "geom_size", "geom_friction", "geom_solref", "pair_solref"),
    *("jnt_pos", "jnt_range", "jnt_stiffness"),
    *("dof_armature", "dof_damping", "dof_frictionloss", "tendon_stiffness", "tendon_damping"),
    *("actuator_gear", "actuator_gainprm", "actuator_biasprm", "actuator_dynprm"),
)
"""Attributes of a model that determine its motion."""

MAX_NAME = 1000
"""Longest name of a motor or a hinge, characters: every message of a log may have all names."""

MAX_ITERATIONS = 10_000
"""Largest number of iterations of a solver; MuJoCo's default is 100 or less. The number of a step
depends on the contacts, so the first steps of a model do not bound it."""

_ITERATIONS = (
    *("iterations", "ls_iterations", "noslip_iterations", "ccd_iterations"),
    *("sdf_iterations", "sdf_initpoints"),
)


def check_model(model: mujoco.MjModel, root: int) -> None:
    """Checks that a robot of this model can be logged, damaged and predicted from its logs.

    Args:
        model: A compiled MJCF.
        root: Id of the root body.

    Raises:
        ValueError: The model has an unsupported part, or a number that is not finite or absurdly
            large; the message contains the name of the part.
    """
    _check_numbers(model)
    base_joints = joints_of_body(model, root)
    for j in range(model.njnt):
        kind = int(model.jnt_type[j])
        if j not in base_joints and kind in _UNSUPPORTED_JOINTS:
            raise ValueError(
                f"the model's joint {_label(model.joint(j))} {_UNSUPPORTED_JOINTS[kind]}: expected "
                f"hinges only, except between the world and the root body"
            )
    if model.nflex or model.nplugin:
        raise ValueError(
            "the model has soft bodies (flex) or plugins, whose state a log does not contain: "
            "expected rigid bodies only"
        )
    for name in _ITERATIONS:
        if getattr(model.opt, name) > MAX_ITERATIONS:
            raise ValueError(
                f"the model has {name}={getattr(model.opt, name)}, expected at most "
                f"{MAX_ITERATIONS}: a step of its physics could take any time"
            )
    for m in range(model.nu):
        _check_motor(model, m)
    _check_names(model)


def _check_numbers(model: mujoco.MjModel) -> None:
    numbers = [(f"option {name}", getattr(model.opt, name)) for name in _OPTIONS]
    numbers += [(name.replace("_", " "), getattr(model, name)) for name in _NUMBERS]
    for name, values in numbers:
        wrong = np.ravel(values)[~(np.abs(np.ravel(values)) <= MAX_NUMBER)]
        if len(wrong):
            raise ValueError(
                f"expected finite numbers of at most {MAX_NUMBER:g} in the model's {name}, got "
                f"{wrong[0]:g}"
            )


def _check_motor(model: mujoco.MjModel, motor: int) -> None:
    name = _label(model.actuator(motor))
    on_site = int(model.actuator_trntype[motor]) == int(mujoco.mjtTrn.mjTRN_SITE)
    if int(model.actuator_trntype[motor]) not in SUPPORTED_TRANSMISSIONS or (
        on_site and model.actuator_trnid[motor, 1] >= 0
    ):
        raise ValueError(
            f"the model's motor {name} has a transmission that is not supported: expected a "
            f"joint, a tendon, a body, or a site without a reference site"
        )
    if (
        int(model.actuator_dyntype[motor]) not in _SUPPORTED_DYNAMICS
        or int(model.actuator_gaintype[motor]) not in _SUPPORTED_GAINS
        or int(model.actuator_biastype[motor]) not in _SUPPORTED_BIASES
        or model.actuator_actnum[motor] > 1
        or model.actuator_delay[motor] > 0
    ):
        raise ValueError(
            f"the model's motor {name} is a muscle, has a delay, or has dynamics of a kind that is "
            f"not supported: expected none, integrator, filter or filterexact"
        )


def _check_names(model: mujoco.MjModel) -> None:
    motors = [model.actuator(m) for m in range(model.nu)]
    hinges = [model.joint(j) for j in range(model.njnt) if model.jnt_type[j] == _HINGE]
    for kind, parts in (("motor", motors), ("hinge", hinges)):
        for part in parts:
            if not part.name:
                raise ValueError(
                    f"the model's {kind} number {int(part.id)} has no name: give it one, because "
                    f"logs and faults identify parts by name"
                )
            if len(part.name) > MAX_NAME:
                raise ValueError(
                    f"expected names of at most {MAX_NAME} characters, got {len(part.name)} in the "
                    f"name of the {kind} {part.name[:20]}...: shorten it"
                )


def _label(part: mujoco.MjModel) -> str:
    return repr(part.name) if part.name else f"number {int(part.id)}"


_PROBE_SECONDS = 0.2
_MAX_PROBE_STEPS = 200


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
        names = [model.body(body).name for body in sorted(roots)]
        raise InputError(
            f"expected one tree of moving bodies, got {listed(names, 12)}: keep the "
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
