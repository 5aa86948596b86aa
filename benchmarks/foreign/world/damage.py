"""Faults made in the specification of a model, before it is compiled."""

import math

import mujoco
import numpy as np

from benchmarks.foreign.faults import Fault
from benchmarks.foreign.robots import Part, Robot
from benchmarks.foreign.world.debris import leave

AIR = (1.2, 1.8e-5)
"""Density, kg/m^3, and viscosity, Pa s, of air at 20 degrees Celsius."""


def damaged(robot: Robot, faults: tuple[Fault, ...], angles: dict[str, float]) -> mujoco.MjSpec:
    """Returns the specification of a robot with its faults.

    Args:
        robot: The robot.
        faults: The faults; those without effect on the model are skipped.
        angles: Angle of each hinge of a jam, where it is not the severity of the fault, rad.
    """
    spec = robot.spec()
    weight = robot.spec().compile().body_mass.sum()
    for fault in faults:
        match fault.kind:
            case "lost":
                _detach(spec, robot.part(fault.part).body, debris=fault.debris)
            case "jam":
                _jam(spec, robot.part(fault.part), fault.value, angles)
            case "payload":
                _load(spec, robot, fault, fault.value * weight)
            case "slope":
                _tilt(spec, robot, np.array([0.0, 1.0, 0.0]), -fault.value)
            case "side-slope":
                _tilt(spec, robot, np.array([1.0, 0.0, 0.0]), fault.value)
            case "backlash":
                _loosen(spec, fault)
            case "tether":
                _tether(spec, robot, fault.value)
            case "wind" | "crosswind":
                spec.option.density, spec.option.viscosity = AIR
                spec.option.wind[0 if fault.kind == "wind" else 1] = fault.value
    return spec


def _detach(spec: mujoco.MjSpec, body: str, *, debris: bool) -> None:
    """Deletes a body with all beyond it; debris stays where it was."""
    if debris:
        leave(spec, body)
    spec.delete(spec.body(body))


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
        for actuator in [a for a in spec.actuators if a.target == hinge]:
            spec.delete(actuator)
        for sensor in [s for s in spec.sensors if s.objname == hinge]:
            spec.delete(sensor)
        spec.delete(spec.joint(hinge))


def _load(spec: mujoco.MjSpec, robot: Robot, fault: Fault, mass: float) -> None:
    """Fixes a box of even density to the root body; it touches nothing."""
    spec.body(robot.root).add_geom(
        name="payload",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[0.06, 0.06, 0.04],
        pos=fault.place,
        mass=mass,
        contype=0,
        conaffinity=0,
    )


def _tilt(spec: mujoco.MjSpec, robot: Robot, axis: np.ndarray, angle: float) -> None:
    """Rotates the ground and the robot's start about the origin; gravity stays along -z."""
    turn = np.empty(4)
    mujoco.mju_axisAngle2Quat(turn, axis, angle)
    for thing in [*spec.worldbody.geoms, spec.body(robot.root)]:
        place, orientation = np.empty(3), np.empty(4)
        mujoco.mju_rotVecQuat(place, np.array(thing.pos), turn)
        mujoco.mju_mulQuat(orientation, turn, np.array(thing.quat))
        thing.pos, thing.quat = place, orientation


def _loosen(spec: mujoco.MjSpec, fault: Fault) -> None:
    """Adds a second hinge, without a motor, about the axis of the first: the play of the gear."""
    joint = spec.joint(fault.part)
    half = fault.value / 2
    if spec.compiler.degree:
        half = math.degrees(half)
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


def _tether(spec: mujoco.MjSpec, robot: Robot, stiffness: float) -> None:
    """Ties the root body to its start by an elastic rope, N/m."""
    spec.worldbody.add_site(name="peg", pos=spec.body(robot.root).pos)
    spec.body(robot.root).add_site(name="hook")
    rope = spec.add_tendon(name="rope", stiffness=stiffness, springlength=[0.0, 0.1])
    rope.wrap_site("peg")
    rope.wrap_site("hook")
