"""The robots of the generator: MJCF files, read as data, with their parts by name."""

import importlib.util
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco

SERVO_GAINS = (150.0, 15.0)
"""Stiffness, N m/rad, and damping, N m s/rad, of the position servos of the ant."""


TOUCH_REACH = 0.02
"""Distance by which the touch sites of the ant extend beyond its feet, m: a contact at rest lies up
to the margin of a geom beyond it, 0.01 m."""


@dataclass(frozen=True)
class Part:
    """A joint in the sense of a diagnosis: all hinges of one body.

    Attributes:
        name: Name of the part; that of its hinge, or the common beginning of its hinges' names.
        body: Name of the body that it moves.
        hinges: Names of the hinges.
        beyond: Names of the hinges of the body and of the bodies beyond it.
        touches: Names of the touch sensors beyond it.
    """

    name: str
    body: str
    hinges: tuple[str, ...]
    beyond: tuple[str, ...]
    touches: tuple[str, ...]


@dataclass(frozen=True)
class Robot:
    """A robot.

    Attributes:
        name: Name of the robot.
        path: Its MJCF file.
        mapped_as: Value of ``robot`` in a mapping.
        root: Name of the root body.
        hinges: Names of the hinges in the order of the model.
        motors: Hinge of each motor.
        touches: Body of each touch sensor.
        parts: The parts, in the order of the model.
        control_timestep: Time between commands, s.
        frequencies: Lowest and highest frequency of drawn gaits, Hz.
        amplitudes: Smallest and largest amplitude of drawn gaits, as parts of half the range.
    """

    name: str
    path: Path
    mapped_as: str
    root: str
    hinges: tuple[str, ...]
    motors: dict[str, str]
    touches: dict[str, str]
    parts: tuple[Part, ...]
    control_timestep: float = 0.01
    frequencies: tuple[float, float] = (0.8, 1.8)
    amplitudes: tuple[float, float] = (0.2, 1.0)

    def part(self, name: str) -> Part:
        """Returns a part by name."""
        return next(part for part in self.parts if part.name == name)

    def spec(self) -> mujoco.MjSpec:
        """Returns a new specification of the robot on its ground."""
        return _spec(self.name, self.path)


NAMES = ("quadruped", "hexapod", "ant")


def robot(name: str) -> Robot:
    """Returns a robot by name, one of ``NAMES``."""
    path = _path(name)
    spec = _spec(name, path)
    model = spec.compile()
    root = model.body(1).name
    hinges = tuple(
        model.joint(k).name
        for k in range(model.njnt)
        if model.jnt_type[k] == mujoco.mjtJoint.mjJNT_HINGE
    )
    motors = {
        model.actuator(k).name: model.joint(model.actuator_trnid[k, 0]).name
        for k in range(model.nu)
    }
    touches = {
        model.sensor(k).name: model.body(model.site_bodyid[model.sensor_objid[k]]).name
        for k in range(model.nsensor)
        if model.sensor_type[k] == mujoco.mjtSensor.mjSENS_TOUCH
    }
    return Robot(
        name=name,
        path=path,
        mapped_as="ant.xml" if name == "ant" else name,
        root=root,
        hinges=hinges,
        motors=motors,
        touches=touches,
        parts=_parts(model, hinges, touches),
    )


def _path(name: str) -> Path:
    """Returns the MJCF file of a robot, without an import of its package."""
    package, inside = (
        ("gymnasium", "envs/mujoco/assets/ant.xml")
        if name == "ant"
        else ("selfmodel", f"tasks/{name}.xml")
    )
    found = importlib.util.find_spec(package)
    if found is None or found.origin is None:
        raise ModuleNotFoundError(
            f"the robot {name} is a file of {package}, which is not installed"
        )
    return Path(found.origin).parent / inside


def _spec(name: str, path: Path) -> mujoco.MjSpec:
    spec = mujoco.MjSpec.from_file(str(path))
    return _ant(spec) if name == "ant" else spec


def radians(spec: mujoco.MjSpec, angles: Sequence[float]) -> list[float]:
    """Returns angles of a specification, which may be in degrees, in radians."""
    return [float(math.radians(angle) if spec.compiler.degree else angle) for angle in angles]


def _ant(spec: mujoco.MjSpec) -> mujoco.MjSpec:
    """Adds names, touch sensors and position servos, as ``ant.toml`` requests them."""
    for motor in spec.actuators:
        motor.name = motor.target
        joint = spec.joint(motor.target)
        stiffness, damping = SERVO_GAINS
        motor.gear = [1, 0, 0, 0, 0, 0]
        motor.set_to_position(kp=stiffness, kv=damping)
        motor.ctrlrange = radians(spec, joint.range)
        motor.forcerange = [-150, 150]
        motor.forcelimited = 1
    for joint in spec.joints:
        body = joint.parent
        if joint.type != mujoco.mjtJoint.mjJNT_HINGE:
            continue
        body.name = body.name or joint.name
        if not body.bodies:
            (geom,) = body.geoms
            site = body.add_site(
                name=f"{joint.name}_site",
                type=mujoco.mjtGeom.mjGEOM_CAPSULE,
                fromto=geom.fromto,
                size=[geom.size[0] + TOUCH_REACH, 0, 0],
            )
            spec.add_sensor(
                name=f"{body.name}_touch",
                type=mujoco.mjtSensor.mjSENS_TOUCH,
                objtype=mujoco.mjtObj.mjOBJ_SITE,
                objname=site.name,
            )
    return spec


def _parts(
    model: mujoco.MjModel, hinges: tuple[str, ...], touches: dict[str, str]
) -> tuple[Part, ...]:
    by_body: dict[str, list[str]] = {}
    for hinge in hinges:
        by_body.setdefault(model.body(model.joint(hinge).bodyid[0]).name, []).append(hinge)
    parts = []
    for body, own in by_body.items():
        beyond = _beyond(model, body)
        parts.append(
            Part(
                name=own[0] if len(own) == 1 else _common(own),
                body=body,
                hinges=tuple(own),
                beyond=tuple(h for b in beyond for h in by_body.get(b, ())),
                touches=tuple(name for name, foot in touches.items() if foot in beyond),
            )
        )
    return tuple(parts)


def _beyond(model: mujoco.MjModel, body: str) -> list[str]:
    """Returns the names of a body and of the bodies beyond it."""
    found = [model.body(body).id]
    for child in range(1, model.nbody):
        if model.body_parentid[child] in found and child not in found:
            found.append(child)
    return [model.body(k).name for k in found]


def _common(names: list[str]) -> str:
    """Returns the common first words of some names."""
    words = zip(*(name.split("_") for name in names), strict=False)
    return "_".join(first for first, *rest in words if all(word == first for word in rest))
