"""What distinguishes one robot in PyBullet from its model: draws of a seed, and damage."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from selfmodel.faults.joints import JAMMED
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import PAPER_KINDS
from selfmodel.faults.sensors import FAILED_SENSOR
from selfmodel.robot.anatomy import Anatomy
from selfmodel.robot.robot import Robot


@dataclass(frozen=True)
class Reality:
    """The draws of one robot. Noise is white and normal; levels are standard deviations."""

    seed: int
    masses: tuple[float, ...]
    """Factor of the mass and inertia of each body, in the order of the model."""
    torques: tuple[float, ...]
    """Factor of the torque of each motor, in the order of the model."""
    gear_stiffness: float = 450.0
    """Torsional stiffness of the gears, N m/rad."""
    delay: int = 0
    """Time from a command to its effect, in substeps."""
    friction: float = 1.0
    restitution: float = 0.0
    start_angle: float = 0.0
    """Deviation of the initial joint angles, rad."""
    start_tilt: float = 0.0
    """Deviation of the initial roll and pitch of the base, rad."""
    angle_noise: float = 0.0
    """Noise of the angle sensors, as a fraction of the range of their hinges."""
    touch_flips: float = 0.0
    """Probability that a touch sensor reads the opposite."""
    encoder_noise: float = 0.0
    speed_noise: float = 0.0
    position_noise: float = 0.0
    tilt_noise: float = 0.0
    velocity_noise: float = 0.0
    turn_noise: float = 0.0


RANGES: dict[str, tuple[Any, Any]] = {
    "gear_stiffness": (300, 600),
    "delay": (5, 21),
    "friction": (0.7, 1.1),
    "restitution": (0.0, 0.1),
    "start_angle": (0.01, 0.03),
    "start_tilt": (0.0, 0.01),
    "angle_noise": (0.01, 0.05),
    "touch_flips": (0.0, 0.02),
    "encoder_noise": (0.005, 0.02),
    "speed_noise": (0.05, 0.2),
    "position_noise": (0.002, 0.01),
    "tilt_noise": (0.002, 0.01),
    "velocity_noise": (0.02, 0.05),
    "turn_noise": (0.02, 0.1),
}
"""Ranges of the draws, in their order; that of the friction is relative to the model's."""


def draw_reality(robot: Robot, seed: int) -> Reality:
    """Returns the draws of a seed; equal seeds have equal draws."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(0,)))
    masses, torques = (
        tuple(map(float, rng.uniform(0.95, 1.05, count)))
        for count in (robot.model.nbody, robot.model.nu)
    )
    drawn: dict[str, Any] = {
        name: int(rng.integers(low, high)) if name == "delay" else float(rng.uniform(low, high))
        for name, (low, high) in RANGES.items()
    }
    ideal = ideal_reality(robot)
    drawn["friction"] = ideal.friction * drawn["friction"]
    return dataclasses.replace(ideal, seed=seed, masses=masses, torques=torques, **drawn)


def ideal_reality(robot: Robot) -> Reality:
    """Returns a robot without noise, delay or deviations of its masses and motors.

    Bullet's contacts and the gears of the servos remain.
    """
    model = robot.model
    # The largest coefficient of two geoms is that of their contact in MuJoCo.
    friction = float(model.geom_friction[:, 0].max())
    return Reality(0, (1.0,) * model.nbody, (1.0,) * model.nu, friction=friction)


@dataclass(frozen=True)
class Damage:
    """Damage, by the names of the parts."""

    lost: frozenset[str] = frozenset()
    """Hinges that are absent with the links that they move: all those beyond a break."""
    fixed: Mapping[str, float] = field(default_factory=dict)
    """Angle of each hinge that became a fixed joint, rad."""
    dead: frozenset[str] = frozenset()
    """Sensors that read 0: failed ones, and touch sensors on absent links."""


def damage_of(notation: str, anatomy: Anatomy) -> Damage:
    """Returns the damage of a notation: ``break:X``, ``jam:X`` and ``sensor:X``, joined by ``+``.

    A jammed joint is fixed at 0, or at the limit nearest to 0.

    Raises:
        InputError: The notation has another kind of fault, or an unknown part.
    """
    lost, dead, fixed = set[str](), set[str](), dict[str, float]()
    for fault in parse(notation, anatomy, PAPER_KINDS).faults:
        if fault.kind == FAILED_SENSOR:
            dead.add(fault.part)
            continue
        joint = anatomy.joint(fault.part)
        if fault.kind == JAMMED:
            for hinge, (low, high) in zip(joint.hinges, joint.limits, strict=True):
                fixed[hinge] = min(max(low, 0.0), high)
            continue
        beyond = [other for other in anatomy.joints if other.name in joint.descendants]
        lost |= {hinge for one in (joint, *beyond) for hinge in one.hinges}
        dead |= {s.name for s in anatomy.sensors if s.kind == "touch" and s.body in joint.bodies}
    kept = {hinge: angle for hinge, angle in fixed.items() if hinge not in lost}
    return Damage(frozenset(lost), kept, frozenset(dead))
