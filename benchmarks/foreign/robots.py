"""The robots of the generator: MJCF files, read as data, with their parts by name."""

import importlib.util
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

SERVO_GAINS = (150.0, 15.0)
"""Stiffness, N m/rad, and damping, N m s/rad, of the position servos of the ant."""

TOUCH_REACH = 0.02
"""Distance by which the touch sites of the ant extend beyond its feet, m: a contact at rest lies up
to the margin of a geom beyond it, 0.01 m."""

NAMES = ("quadruped", "hexapod", "ant", "go2")


@dataclass(frozen=True)
class Part:
    """A joint in the sense of a diagnosis: the hinges of one body, and what is beyond them."""

    name: str
    body: str
    hinges: tuple[str, ...]
    beyond: tuple[str, ...]
    """Hinges of the body and of the bodies beyond it."""
    touches: tuple[str, ...]
    """Touch sensors beyond it."""


@dataclass(frozen=True)
class Robot:
    """A robot: names in the order of its model, and the ranges of drawn gaits."""

    name: str
    path: Path
    mapped_as: str
    """Value of ``robot`` in a mapping."""
    root: str
    hinges: tuple[str, ...]
    motors: dict[str, str]
    """Hinge of each motor."""
    touches: dict[str, str]
    """Body of each touch sensor."""
    parts: tuple[Part, ...]
    control_timestep: float
    has_odometry: bool
    """Whether odometry and touch sensors are recorded; else an IMU is."""
    frequencies: tuple[float, float] = (0.8, 1.8)
    amplitudes: tuple[float, float] = (0.2, 1.0)

    def part(self, name: str) -> Part:
        """Returns a part by name."""
        return next(part for part in self.parts if part.name == name)

    def spec(self) -> mujoco.MjSpec:
        """Returns a new specification of the robot on its ground."""
        return _spec(self.name, self.path)


def robot(name: str) -> Robot:
    """Returns a robot by name, one of ``NAMES``."""
    path = _path(name)
    model = _spec(name, path).compile()
    hinges = tuple(
        model.joint(k).name
        for k in range(model.njnt)
        if model.jnt_type[k] == mujoco.mjtJoint.mjJNT_HINGE
    )
    touches = {
        model.sensor(k).name: model.body(model.site_bodyid[model.sensor_objid[k]]).name
        for k in range(model.nsensor)
        if model.sensor_type[k] == mujoco.mjtSensor.mjSENS_TOUCH
    }
    return Robot(
        name=name,
        path=path,
        mapped_as=f"{name}.xml" if name in ("ant", "go2") else name,
        root=model.body(1).name,
        hinges=hinges,
        motors={
            model.actuator(k).name: model.joint(model.actuator_trnid[k, 0]).name
            for k in range(model.nu)
        },
        touches=touches,
        parts=tuple(_parts(model, hinges, touches)),
        control_timestep=0.02 if name == "go2" else 0.01,
        has_odometry=name != "go2",
    )


def _path(name: str) -> Path:
    """Returns the MJCF file of a robot, without an import of its package."""
    if name == "go2":
        return Path(__file__).with_name("go2.xml")
    package, inside = (
        ("gymnasium", "envs/mujoco/assets/ant.xml")
        if name == "ant"
        else ("selfmodel", f"tasks/{name}.xml")
    )
    found = importlib.util.find_spec(package)
    if found is None or found.origin is None:
        raise ModuleNotFoundError(f"the robot {name} is a file of {package}: install it")
    return Path(found.origin).parent / inside


def _spec(name: str, path: Path) -> mujoco.MjSpec:
    spec = mujoco.MjSpec.from_file(str(path))
    return _ant(spec) if name == "ant" else spec


def _ant(spec: mujoco.MjSpec) -> mujoco.MjSpec:
    """Adds names, touch sensors and position servos, as ``ant.toml`` requests them."""
    for motor in spec.actuators:
        motor.name = motor.target
        stiffness, damping = SERVO_GAINS
        motor.gear = [1, 0, 0, 0, 0, 0]
        motor.set_to_position(kp=stiffness, kv=damping)
        motor.ctrlrange = np.radians(spec.joint(motor.target).range)
        motor.forcerange, motor.forcelimited = [-150, 150], 1
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
) -> Iterator[Part]:
    by_body: dict[str, list[str]] = {}
    for hinge in hinges:
        by_body.setdefault(model.body(model.joint(hinge).bodyid[0]).name, []).append(hinge)
    for body, names in by_body.items():
        beyond = [model.body(body).id]
        for child in range(1, model.nbody):
            if model.body_parentid[child] in beyond and child not in beyond:
                beyond.append(child)
        bodies = [model.body(k).name for k in beyond]
        words = zip(*(name.split("_") for name in names), strict=False)
        yield Part(
            name="_".join(first for first, *rest in words if all(w == first for w in rest)),
            body=body,
            hinges=tuple(names),
            beyond=tuple(hinge for b in bodies for hinge in by_body.get(b, ())),
            touches=tuple(name for name, foot in touches.items() if foot in bodies),
        )
