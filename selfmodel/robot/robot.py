"""Robot: an MJCF model, its parts by name, its control time step; models that can be none."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from xml.etree import ElementTree as ET  # of checked texts

import mujoco
import numpy as np

from selfmodel.errors import InputError, listed, typed
from selfmodel.robot import anatomy_reader
from selfmodel.robot.actuators import SUPPORTED_TRANSMISSIONS, motor_joints
from selfmodel.robot.anatomy import (
    CONTROL_DELAY,
    FITTED_CONTACTS,
    UNKNOWN_GROUND,
    Anatomy,
    control_delay,
    custom_numeric,
)
from selfmodel.robot.mjcf.untrusted import parse_xml
from selfmodel.robot.mujoco_errors import configure, loading_a_model

configure()

MAX_NUMBER = float(mujoco.mjMAXVAL)
"""Largest number of a model: MuJoCo resets a simulation whose state or acceleration exceeds it."""

MAX_NAME = 1000
"""Longest name of a part, characters: messages of a log and refusals have names."""

MAX_ITERATIONS = 10_000
"""Largest number of iterations of a solver; MuJoCo's default is 100 or less. The number of a step
depends on the contacts, so the first steps of a model do not bound it."""


@typed
@dataclass(frozen=True, eq=False)
class Robot:
    """A healthy robot: its MJCF model and its control time step.

    The MJCF contains all properties but the control time step, so that a log with both contains
    the robot. The forward direction is the world's x axis at the initial pose.

    Attributes:
        name: Name of the robot.
        mjcf: The MJCF as one XML text without includes; ``assets`` contains its files.
        control_timestep: Time between two commands, s.
        assets: Contents of the files that the MJCF names, such as meshes, by file name.
        notes: What was changed about the user's file to make it the MJCF, one sentence each.
        model: The compiled model.
        anatomy: Joints, sensors and motors.
        root: Name of the root body, whose displacement is the displacement of the robot; a robot
            with a fixed base has none.
    """

    name: str
    mjcf: str
    control_timestep: float
    assets: Mapping[str, bytes] = field(default_factory=dict, repr=False)
    notes: tuple[str, ...] = field(default=(), repr=False)
    model: mujoco.MjModel = field(init=False, repr=False)
    anatomy: Anatomy = field(init=False, repr=False)
    root: str = field(init=False)

    def __post_init__(self) -> None:
        model = mujoco.MjModel.from_xml_string(self.mjcf, dict(self.assets))
        root = check_model(model)
        object.__setattr__(self, "model", model)
        object.__setattr__(self, "anatomy", anatomy_reader.read_anatomy(model, root))
        object.__setattr__(self, "root", str(model.body(root).name))
        if not np.isclose(self.substeps * model.opt.timestep, self.control_timestep, rtol=1e-9):
            raise ValueError(
                f"the control time step {self.control_timestep} s must be a multiple of the "
                f"physics time step {model.opt.timestep} s"
            )
        control_delay(model, self.substeps)  # raises ValueError

    def __repr__(self) -> str:
        names = self.anatomy
        return (
            f"<Robot {self.name}: {len(names.joints)} joints, {len(names.motors)} motors, "
            f"{len(names.sensors)} sensors, control time step {self.control_timestep:g} s>"
        )

    @property
    def substeps(self) -> int:
        """Number of physics steps per control step."""
        return max(1, round(self.control_timestep / float(self.model.opt.timestep)))

    @property
    def control_delay(self) -> float:
        """Control delay of the model, in control steps; see ``CONTROL_DELAY``."""
        return control_delay(self.model, self.substeps)

    @property
    def is_calibrated(self) -> bool:
        """Whether the model is the result of a calibration, which adds a control delay."""
        return custom_numeric(self.model, CONTROL_DELAY) is not None

    @property
    def has_fitted_contacts(self) -> bool:
        """Whether a calibration changed the contacts of the model."""
        return custom_numeric(self.model, FITTED_CONTACTS) is not None

    @property
    def has_unknown_ground(self) -> bool:
        """Whether the ground is of the import, and no calibration was made on the real one."""
        return custom_numeric(self.model, UNKNOWN_GROUND) is not None and not self.is_calibrated

    @property
    def standing_height(self) -> float:
        """Height of the root body above the ground in the initial pose, m."""
        position, _ = anatomy_reader.reference_pose(self.model, int(self.model.body(self.root).id))
        return float(position[2])

    @property
    def has_fixed_base(self) -> bool:
        """Whether the root body is welded to the world: an arm, or a robot on a stand."""
        return not self.model.body(self.root).jntnum[0]

    def finer(self, parts: int) -> "Robot":
        """Returns the robot with that many physics steps in place of each, and all else the same.

        Contacts whose time constant is below two physics steps, which MuJoCo lengthens to them, are
        nearer to what the MJCF says.
        """
        root = parse_xml(self.mjcf)
        # MuJoCo merges repeated sections, and the last value counts.
        ET.SubElement(root, "option", timestep=repr(float(self.model.opt.timestep) / parts))
        return replace(self, mjcf=ET.tostring(root, encoding="unicode"))

    def specification(self) -> mujoco.MjSpec:
        """Returns the MJCF as an editable MjSpec."""
        return mujoco.MjSpec.from_string(self.mjcf, assets=dict(self.assets))


def mjcf_of(spec: mujoco.MjSpec) -> str:
    """Returns a specification as MJCF: to six digits, but for the exact physics time step.

    A control time step is a multiple of it, and 1/240 s has more than six digits.
    """
    step, text = float(spec.option.timestep), str(spec.to_xml())
    return text.replace(f'timestep="{step:.6g}"', f'timestep="{step!r}"')


_HINGE = int(mujoco.mjtJoint.mjJNT_HINGE)
_UNSUPPORTED_JOINTS = {
    int(mujoco.mjtJoint.mjJNT_SLIDE): "slide",
    int(mujoco.mjtJoint.mjJNT_BALL): "ball",
}
_DYN, _GAIN, _BIAS = mujoco.mjtDyn, mujoco.mjtGain, mujoco.mjtBias
_SUPPORTED = {
    "actuator_dyntype": (
        *(_DYN.mjDYN_NONE, _DYN.mjDYN_INTEGRATOR),
        *(_DYN.mjDYN_FILTER, _DYN.mjDYN_FILTEREXACT),
    ),
    "actuator_gaintype": (_GAIN.mjGAIN_FIXED, _GAIN.mjGAIN_AFFINE),
    "actuator_biastype": (_BIAS.mjBIAS_NONE, _BIAS.mjBIAS_AFFINE),
}
_OPTIONS = ("timestep", "gravity", "wind", "magnetic", "density", "viscosity")
_NUMBERS = (
    *("qpos0", "body_pos", "body_quat", "body_ipos", "body_mass", "body_inertia"),
    *("geom_pos", "geom_size", "geom_friction", "geom_solref", "pair_solref"),
    *("jnt_pos", "jnt_range", "jnt_stiffness"),
    *("dof_armature", "dof_damping", "dof_frictionloss", "tendon_stiffness", "tendon_damping"),
    *("actuator_gear", "actuator_gainprm", "actuator_biasprm", "actuator_dynprm"),
)
"""Attributes of a model that determine its motion."""

_ITERATIONS = (
    *("iterations", "ls_iterations", "noslip_iterations", "ccd_iterations"),
    *("sdf_iterations", "sdf_initpoints"),
)


def check_model(model: mujoco.MjModel) -> int:
    """Checks that a robot can be logged, damaged and predicted; returns the id of its root body.

    Raises:
        ValueError: The model has an unsupported part, or a number that is not finite or absurdly
            large; the message contains the name of the part.
    """
    _check_longest_name(model)  # first: the others print names
    root = anatomy_reader.find_root_body(model)
    if not model.opt.timestep > 0:
        raise ValueError(
            f"the model's <option timestep> must be above 0 s, got {model.opt.timestep}"
        )
    numbers = [(f"option {name}", getattr(model.opt, name)) for name in _OPTIONS]
    numbers += [(name.replace("_", " "), getattr(model, name)) for name in _NUMBERS]
    for name, values in numbers:
        wrong = np.ravel(values)[~(np.abs(np.ravel(values)) <= MAX_NUMBER)]
        if len(wrong):
            raise ValueError(
                f"expected finite numbers of at most {MAX_NUMBER:g} in the model's {name}, got "
                f"{wrong[0]:g}"
            )
    base_joints = anatomy_reader.joints_of_body(model, root)
    for j in range(model.njnt):
        kind = int(model.jnt_type[j])
        if j not in base_joints and kind in _UNSUPPORTED_JOINTS:
            raise ValueError(
                f"the model's joint {_label(model.joint(j))} is a {_UNSUPPORTED_JOINTS[kind]} "
                f"joint: expected hinges only, except between the world and the root body"
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
    hinges = [model.joint(int(j)) for j in np.flatnonzero(model.jnt_type == _HINGE)]
    _check_names("motor", [model.actuator(m) for m in range(model.nu)])
    _check_names("hinge", hinges)
    return root


def _check_motor(model: mujoco.MjModel, motor: int) -> None:
    name = _label(model.actuator(motor))
    kind, reference = int(model.actuator_trntype[motor]), model.actuator_trnid[motor, 1]
    if kind not in SUPPORTED_TRANSMISSIONS or (
        kind == int(mujoco.mjtTrn.mjTRN_SITE) and reference >= 0
    ):
        raise ValueError(
            f"the model's motor {name} has a transmission that is not supported: expected a "
            f"joint, a tendon, a body, or a site without a reference site"
        )
    supported = all(
        int(getattr(model, field)[motor]) in map(int, kinds) for field, kinds in _SUPPORTED.items()
    )
    if not supported or model.actuator_actnum[motor] > 1 or model.actuator_delay[motor] > 0:
        raise ValueError(
            f"the model's motor {name} is a muscle, has a delay, or has dynamics of a kind that is "
            f"not supported: expected none, integrator, filter or filterexact"
        )


def _check_names(kind: str, parts: list[mujoco.MjModel]) -> None:
    for part in parts:
        if not part.name:
            raise ValueError(
                f"the model's {kind} number {int(part.id)} has no name: give it one, because "
                f"logs and faults identify parts by name"
            )


def _check_longest_name(model: mujoco.MjModel) -> None:
    longest = max(bytes(model.names).decode(errors="replace").split("\0"), key=len)
    if len(longest) > MAX_NAME:
        raise ValueError(
            f"expected names of at most {MAX_NAME} characters, got {len(longest)} in "
            f"{longest[:20]}...: shorten it"
        )


def _label(part: mujoco.MjModel) -> str:
    return repr(part.name) if part.name else f"number {int(part.id)}"


_PROBE_SECONDS, _MAX_PROBE_STEPS = 0.2, 200
_UNSTABLE = (
    mujoco.mjtWarning.mjWARN_BADQPOS,
    mujoco.mjtWarning.mjWARN_BADQVEL,
    mujoco.mjtWarning.mjWARN_BADQACC,
)


def check_usable(model: mujoco.MjModel) -> None:
    """Checks that a model can be simulated, driven, logged and diagnosed.

    Raises:
        InputError: The model cannot be a robot; the message has the reason and the part.
    """
    tops = sorted({int(model.body_rootid[body]) for body in model.jnt_bodyid})
    if len(tops) > 1:  # a log contains the state of one robot
        raise InputError(
            f"expected one tree of moving bodies, got "
            f"{listed([model.body(body).name for body in tops], 12)}: keep the robot, and remove "
            f"the other bodies or fix them to the world"
        )
    if not anatomy_reader.driven_joints(model):
        raise InputError(
            "the model has no actuators, or its motors drive no joint, so no fault could be "
            "diagnosed: give the joints of its limbs motors in <actuator>"
        )
    try:
        root = check_model(model)
    except ValueError as error:
        raise InputError(str(error)) from error
    base_joints = anatomy_reader.joints_of_body(model, root)
    for motor in range(model.nu):
        for joint in motor_joints(model, motor).intersection(base_joints):
            raise InputError(
                f"the motor {model.actuator(motor).name} drives {model.joint(joint).name} of the "
                f"root body {model.body(root).name}, which only the limbs may move: remove the "
                f"motor"
            )
    steps = min(_MAX_PROBE_STEPS, max(1, round(_PROBE_SECONDS / model.opt.timestep)))
    with loading_a_model():
        data = mujoco.MjData(model)
        mujoco.mj_step(model, data, steps)
    if any(data.warning[kind].number for kind in _UNSTABLE):
        raise InputError(
            f"the simulation diverges within {steps * model.opt.timestep:.2g} s, without "
            f"commands: give the model a smaller <option timestep>, or realistic masses and joints"
        )
