"""The URDF of the hexapod, the self-models that are imported from it, and its failed legs."""

import tempfile
from collections.abc import Mapping, Sequence
from math import pi
from pathlib import Path
from typing import Any, NamedTuple

import selfmodel
from selfmodel import Robot
from selfmodel.robot.mjcf.settings import checked_settings

Vector = tuple[float, float, float]

EFFORT, VELOCITY = 2.0, 6.0
"""Largest torque, N m, and speed, rad/s, of a servo: between those of an AX-12 and an MX-28."""

CONTROL_TIMESTEP, STEPS = 0.025, 200
"""Time between two commands, s: six steps of Bullet. Control steps of a trial of 5 s."""

LEGS: Mapping[str, Vector] = {
    "front_left": (0.11, 0.08, pi / 4),
    "middle_left": (0.0, 0.1, pi / 2),
    "back_left": (-0.11, 0.08, 3 * pi / 4),
    "back_right": (-0.11, -0.08, -3 * pi / 4),
    "middle_right": (0.0, -0.1, -pi / 2),
    "front_right": (0.11, -0.08, -pi / 4),
}
"""Place of each leg on the body, m, and direction, rad, in their order around it."""


class Part(NamedTuple):
    """A part of a leg: a link, and the joint that moves it, at 0 in the stance."""

    length: float
    """Distance to the next part, m."""
    mass: float
    pitch: float
    """Downward angle against the part before in the stance, rad."""
    limits: tuple[float, float]
    retracted: float
    """Angle of the joint at which a failed leg is locked, rad: its foot is 7 cm up."""


PARTS: Mapping[str, Part] = {
    "coxa": Part(0.05, 0.09, 0.0, (-0.7, 0.7), 0.0),
    "femur": Part(0.08, 0.11, -0.4, (-1.0, 0.8), -0.9),
    "tibia": Part(0.13, 0.06, 1.8, (-0.8, 0.8), 0.5),
}

_SERVO: Mapping[str, Any] = {"kp": 40.0, "kd": 5 / 3, "timestep": 1 / 240}
_DAMPED: Mapping[str, Any] = {**_SERVO, "damping": EFFORT / VELOCITY, "velocity": 0}
MODELS: Mapping[str, Mapping[str, Any]] = {
    "import": {"timestep": 0.0025},
    "soft": {"timestep": 0.0025, "kp": EFFORT / 0.5},
    "stiff": {"timestep": 0.0025, "kp": 4 * EFFORT / 0.125},
    "servo": _SERVO,
    "damped": _DAMPED,
    "rotor": {**_DAMPED, "armature": 0.005, "solref": [0.01, 1.0]},
}
"""Settings of each self-model: as imported, but with a time step that divides the control step; of
a quarter and of four times the stiffness; with gains as Bullet's motors have them at their time
step: a speed that would end a tenth of the error in a step; with damping at which the effort
reaches the velocity limit in place of that limit; and with rotors and harder contacts."""

GAIN = 0.1
"""Position gain of Bullet's motors by default; ``servo`` has kp / kd = gain / time step."""

CASES: Mapping[str, Sequence[str]] = {
    "one leg": ("front_left", "middle_right"),
    "opposite": ("middle_left+middle_right", "front_left+back_right"),
    "one apart": ("front_left+back_left", "middle_left+front_right"),
    "neighbours": ("front_left+middle_left", "back_left+back_right"),
}
"""Legs of each case, all of whose joints are locked at the angles of ``PARTS``, by group."""


def urdf() -> str:
    """Returns the URDF: links of boxes and capsules that are solid, and feet that are spheres."""
    box = _link("body", 1.1, (0.24, 0.2, 0.05), '<box size="0.24 0.2 0.05"/>')
    legs = (_leg(leg, *place) for leg, place in LEGS.items())
    return "\n".join(['<robot name="hexapod">', box, *legs, "</robot>"])


def _leg(leg: str, x: float, y: float, yaw: float) -> str:
    parent, place, turn, elements = "body", (x, y, 0.0), (0.0, 0.0, yaw), list[str]()
    for name, part in PARTS.items():
        # Joints that turn positively swing a leg of either side forward, and lower it.
        axis = (0.0, 1.0, 0.0) if name != "coxa" else (0.0, 0.0, -1.0 if y > 0 else 1.0)
        link, turn = f"{leg}_{name}_link", (0.0, part.pitch, turn[2])
        elements.append(
            f'<joint name="{leg}_{name}" type="revolute">{_origin(place, turn)}'
            f'<parent link="{parent}"/><child link="{link}"/><axis xyz="{_text(axis)}"/>'
            f'<limit lower="{part.limits[0]}" upper="{part.limits[1]}" effort="{EFFORT}" '
            f'velocity="{VELOCITY}"/></joint>'
        )
        shape = f'<capsule radius="0.012" length="{part.length - 0.024}"/>'
        along = _origin((part.length / 2, 0.0, 0.0), (0.0, pi / 2, 0.0))
        elements.append(_link(link, part.mass, (0.03, 0.03, part.length), shape, along))
        parent, place, turn = link, (part.length, 0.0, 0.0), (0.0, 0.0, 0.0)
    foot = _link(f"{leg}_foot", 0.01, (0.02, 0.02, 0.02), '<sphere radius="0.015"/>')
    ankle = (
        f'<joint name="{leg}_ankle" type="fixed">{_origin(place, turn)}'
        f'<parent link="{parent}"/><child link="{leg}_foot"/></joint>'
    )
    return "\n".join([*elements, foot, ankle])


def _link(name: str, mass: float, size: Vector, shape: str, origin: str = "") -> str:
    """Returns a link with the inertia of a box of a size, in the frame of its shape."""
    x, y, z = (mass * side**2 / 12 for side in size)
    return (
        f'<link name="{name}"><inertial>{origin}<mass value="{mass}"/>'
        f'<inertia ixx="{y + z}" iyy="{x + z}" izz="{x + y}" ixy="0" ixz="0" iyz="0"/></inertial>'
        f"<collision>{origin}<geometry>{shape}</geometry></collision></link>"
    )


def _origin(place: Vector, turn: Vector) -> str:
    return f'<origin xyz="{_text(place)}" rpy="{_text(turn)}"/>'


def _text(values: Vector) -> str:
    return " ".join(map(repr, values))


def self_model(name: str, part: int = 1) -> Robot:
    """Returns one of ``MODELS``, at a part of its time step, such as 4 for a quarter."""
    given = {**MODELS[name], "timestep": MODELS[name]["timestep"] / part}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "hexapod.urdf")
        path.write_text(urdf(), encoding="utf-8")
        settings = checked_settings({"control_timestep": CONTROL_TIMESTEP, **given})
        return selfmodel.load_robot(path, settings)


def retracted(legs: str) -> dict[str, float]:
    """Returns the angle of each joint of failed legs, rad; of no leg for ``intact``."""
    failed = legs.split("+") if legs != "intact" else []
    return {f"{leg}_{part}": one.retracted for leg in failed for part, one in PARTS.items()}
