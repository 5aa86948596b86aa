"""The compiled model of a robot with its faults, and with the gap between it and its model."""

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from benchmarks.foreign.cases import Fault, Faults
from benchmarks.foreign.robots import Part, Robot

LEVELS = {"none": 0.0, "moderate": 0.5, "large": 1.0}
"""Size of each gap, relative to the large one."""

AIR = (1.2, 1.8e-5)
"""Density, kg/m^3, and viscosity, Pa s, of air at 20 degrees Celsius."""

BODY, JOINT, ACTUATOR, SENSOR = (
    *(mujoco.mjtObj.mjOBJ_BODY, mujoco.mjtObj.mjOBJ_JOINT),
    *(mujoco.mjtObj.mjOBJ_ACTUATOR, mujoco.mjtObj.mjOBJ_SENSOR),
)


@dataclass(frozen=True)
class Gap:
    """One robot's gap. Factors are by name, so that a robot with fewer parts has the same ones."""

    size: float
    """Relative to the large gap."""
    mass: dict[str, float]
    gain: dict[str, float]
    damping: dict[str, float]
    joint_friction: dict[str, float]
    """Dry friction of each hinge, N m."""
    grip: dict[str, float]
    """Factor of the friction of each foot's body."""
    shift: np.ndarray
    """Displacement of the root body's centre of mass, m."""

    @property
    def latency(self) -> tuple[float, float]:
        """Delay of commands and its largest deviation, s."""
        return 0.02 * self.size, 0.004 * self.size


def draw_gap(robot: Robot, size: float, rng: np.random.Generator) -> Gap:
    """Returns the gap of a robot; the draws are the same for every size."""
    bodies = [body.name for body in robot.spec().bodies if body.name]

    def factors(names: list[str], spread: float) -> dict[str, float]:
        return {name: 1 + size * spread * rng.uniform(-1, 1) for name in names}

    return Gap(
        size=size,
        mass=factors(bodies, 0.1),
        gain=factors(list(robot.motors), 0.1),
        damping=factors(list(robot.hinges), 0.2),
        joint_friction={name: size * rng.uniform(0, 0.1) for name in robot.hinges},
        grip=factors(list(robot.touches.values()), 0.1),
        shift=size * 0.01 * rng.uniform(-1, 1, 3) / np.sqrt(3),
    )


def compiled(
    robot: Robot, gap: Gap, faults: Faults, angles: dict[str, float] | None = None
) -> mujoco.MjModel:
    """Returns the model of a robot; ``angles`` are those of hinges that jam where they are, rad."""
    spec = robot.spec()
    weight = robot.spec().compile().body_mass.sum()
    for fault in faults:
        _edit(spec, robot, fault, weight, angles or {})
    model = spec.compile()
    if gap.size:
        _apply(model, robot, gap)
    for fault in faults:
        _change(model, robot, gap, fault)
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def ids(model: mujoco.MjModel, kind: mujoco.mjtObj, names: list[str]) -> np.ndarray:
    """Returns the number of each name, -1 for those that the model does not have."""
    return np.array([mujoco.mj_name2id(model, kind, name) for name in names], dtype=int)


def _edit(
    spec: mujoco.MjSpec, robot: Robot, fault: Fault, weight: float, angles: dict[str, float]
) -> None:
    """Makes a fault in the specification; one without effect on it is skipped."""
    root = spec.body(robot.root)
    match fault.kind:
        case "lost":
            limb = robot.part(fault.part).body
            if fault.debris:
                _leave(spec, limb)
            spec.delete(spec.body(limb))
        case "jam":
            _jam(spec, robot.part(fault.part), fault.value, angles)
        case "payload":
            root.add_geom(
                name="payload",
                type=mujoco.mjtGeom.mjGEOM_BOX,
                size=[0.06, 0.06, 0.04],
                pos=fault.place,
                mass=fault.value * weight,
                contype=0,
                conaffinity=0,
            )
        case "slope":
            _tilt(spec, robot, np.array([0.0, 1.0, 0.0]), -fault.value)
        case "side-slope":
            _tilt(spec, robot, np.array([1.0, 0.0, 0.0]), fault.value)
        case "backlash":
            _loosen(spec, fault)
        case "tether":
            spec.worldbody.add_site(name="peg", pos=root.pos)
            root.add_site(name="hook")
            rope = spec.add_tendon(name="rope", stiffness=fault.value, springlength=[0.0, 0.1])
            rope.wrap_site("peg")
            rope.wrap_site("hook")
        case "wind":
            spec.option.density, spec.option.viscosity = AIR
            spec.option.wind[0] = fault.value


def _jam(spec: mujoco.MjSpec, part: Part, value: float, angles: dict[str, float]) -> None:
    """Fixes a body at the angles of its hinges, and deletes the hinges with their motors."""
    body = spec.body(part.body)
    for hinge in part.hinges:
        joint = spec.joint(hinge)
        turn, orientation = np.empty(4), np.empty(4)
        angle = angles.get(hinge, value) - joint.ref
        mujoco.mju_axisAngle2Quat(turn, np.array(joint.axis), angle)
        mujoco.mju_mulQuat(orientation, np.array(body.quat), turn)
        body.quat = orientation
    for hinge in part.hinges:
        for element in (
            *[actuator for actuator in spec.actuators if actuator.target == hinge],
            *[sensor for sensor in spec.sensors if sensor.objname == hinge],
            spec.joint(hinge),
        ):
            spec.delete(element)


def _tilt(spec: mujoco.MjSpec, robot: Robot, axis: np.ndarray, angle: float) -> None:
    """Rotates the ground and the robot's start about the origin; gravity stays along -z."""
    turn = np.empty(4)
    mujoco.mju_axisAngle2Quat(turn, axis, angle)
    for element in [*spec.worldbody.geoms, spec.body(robot.root)]:
        place, orientation = np.empty(3), np.empty(4)
        mujoco.mju_rotVecQuat(place, np.array(element.pos), turn)
        mujoco.mju_mulQuat(orientation, turn, np.array(element.quat))
        element.pos, element.quat = place, orientation


def _loosen(spec: mujoco.MjSpec, fault: Fault) -> None:
    """Adds a second hinge, without a motor, about the axis of the first: the play of the gear."""
    joint = spec.joint(fault.part)
    half = math.degrees(fault.value / 2) if spec.compiler.degree else fault.value / 2
    joint.parent.add_joint(
        name=f"{fault.part}_play",
        type=mujoco.mjtJoint.mjJNT_HINGE,
        axis=joint.axis,
        pos=joint.pos,
        limited=1,
        range=[-half, half],
        armature=0.001,
        damping=0.01,
    )


def _leave(spec: mujoco.MjSpec, body: str) -> None:
    """Adds a free body with the geoms of a limb, where the limb is in the initial pose.

    Its bodies are rigidly connected, as those of a limb whose motors hold it.
    """
    whole = spec.copy()
    model = whole.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    root = model.body(body).id
    debris = spec.worldbody.add_body(name="debris", pos=data.xpos[root], quat=data.xquat[root])
    debris.add_freejoint()
    inverse = np.empty(4)
    mujoco.mju_negQuat(inverse, data.xquat[root])
    for geom in [geom.id for geom in whole.body(body).find_all(mujoco.mjtObj.mjOBJ_GEOM)]:
        place, turned, orientation = np.empty(3), np.empty(4), np.empty(4)
        mujoco.mju_rotVecQuat(place, data.geom_xpos[geom] - data.xpos[root], inverse)
        mujoco.mju_mat2Quat(turned, data.geom_xmat[geom])
        mujoco.mju_mulQuat(orientation, inverse, turned)
        owner = int(model.geom_bodyid[geom])
        debris.add_geom(
            type=mujoco.mjtGeom(int(model.geom_type[geom])),
            size=model.geom_size[geom],
            pos=place,
            quat=orientation,
            mass=float(model.body_mass[owner] / model.body_geomnum[owner]),
            friction=model.geom_friction[geom],
            contype=int(model.geom_contype[geom]),
            conaffinity=int(model.geom_conaffinity[geom]),
        )


def _apply(model: mujoco.MjModel, robot: Robot, gap: Gap) -> None:
    """Changes a compiled model by a gap."""
    for name, body in zip(gap.mass, ids(model, BODY, list(gap.mass)), strict=True):
        if body > 0:
            model.body_mass[body] *= gap.mass[name]
            model.body_inertia[body] *= gap.mass[name]
    model.body(robot.root).ipos += gap.shift
    for name, motor in zip(gap.gain, ids(model, ACTUATOR, list(gap.gain)), strict=True):
        if motor >= 0:
            model.actuator_gainprm[motor] *= gap.gain[name]
            model.actuator_biasprm[motor] *= gap.gain[name]
    for name, joint in zip(gap.damping, ids(model, JOINT, list(gap.damping)), strict=True):
        if joint >= 0:
            model.dof_damping[model.jnt_dofadr[joint]] *= gap.damping[name]
            model.dof_frictionloss[model.jnt_dofadr[joint]] += gap.joint_friction[name]
    model.geom_friction[:, 0] *= 1 - 0.2 * gap.size
    for name, factor in gap.grip.items():
        _set_grip(model, name, factor)
    model.opt.timestep = 0.001
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    mujoco.mj_setConst(model, mujoco.MjData(model))


def _set_grip(model: mujoco.MjModel, body: str, factor: float) -> None:
    """Scales the friction of a foot, which then takes precedence over that of the ground."""
    (number,) = ids(model, BODY, [body])
    if number > 0:
        geoms = np.flatnonzero(model.geom_bodyid == number)
        model.geom_friction[geoms, 0] *= factor
        model.geom_priority[geoms] = 1


def _change(model: mujoco.MjModel, robot: Robot, gap: Gap, fault: Fault) -> None:
    """Changes the numbers of a compiled model by a fault of a joint, a body or the ground."""
    match fault.kind:
        case "motor" | "damping" | "joint-friction":
            hinges = robot.part(fault.part).hinges
            dofs = [int(model.joint(hinge).dofadr[0]) for hinge in hinges]
            names = [motor for motor, hinge in robot.motors.items() if hinge in hinges]
            motors = [motor for motor in ids(model, ACTUATOR, names) if motor >= 0]
            if fault.kind == "motor":
                model.actuator_gainprm[motors] *= fault.value
                model.actuator_biasprm[motors] *= fault.value
                model.actuator_forcerange[motors] *= fault.value
            elif fault.kind == "damping":
                model.dof_damping[dofs] *= fault.value
            else:
                model.dof_frictionloss[dofs] += fault.value * model.actuator_forcerange[motors, 1]
        case "friction":
            model.geom_friction[:, 0] = fault.value
            for name, factor in gap.grip.items():
                _set_grip(model, name, factor)
        case "grip":
            _set_grip(model, robot.part(fault.part).body, fault.value)
        case "heavy-limb":
            body = model.body(fault.part).id
            model.body_mass[body] *= fault.value
            model.body_inertia[body] *= fault.value
        case "soft-ground":
            model.geom_solref[:] = (-fault.value, -fault.value / 20)
        case "short-range":
            middle = float(model.joint(fault.part).range.mean())
            model.joint(fault.part).range = (middle - fault.value, middle + fault.value)
