"""The reality gap: how a physical robot differs from its model where no hypothesis names it."""

import copy
import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.errors import InputError
from selfmodel.faults.build import compile_model
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.robot.robot import Robot
from selfmodel.robot.scaling import scale_model

WIDEST = 0.5
"""The largest level: beyond it, a third of the factors would be at their floor or unbelievable."""

FLOOR = 0.2
"""No factor is below this: a body keeps a mass, a motor a force, a foot a grip."""

LONGEST_DELAY = 2
"""Control steps that a command can take to reach the motors."""

DEBRIS = "debris_"
"""What the names in a physical model begin with that belong to a limb that fell off."""


@dataclass(frozen=True)
class Gap:
    """One drawing of the reality gap: one physical robot, with the noise of its instruments.

    Attributes:
        level: The relative standard deviation that everything is drawn by; 0 is no gap.
        mass: Multiplies each body's mass, by the body's name.
        inertia: Multiplies each body's principal moments of inertia, likewise.
        friction: Multiplies the sliding friction of every geom and contact pair.
        damping: Multiplies the damping of every joint.
        motors: Multiplies each motor's torque before its limits, by the motor's name.
        delay: Control steps that a command takes to reach the motors.
        seed: From which the noise and the start of every trial are drawn.
    """

    level: float
    mass: Mapping[str, float]
    inertia: Mapping[str, float]
    friction: float
    damping: float
    motors: Mapping[str, float]
    delay: int
    seed: int

    def as_values(self) -> dict[str, Any]:
        """Returns its numbers as plain values, for a log."""
        return dataclasses.asdict(self)


def draw_gap(robot: Robot, level: float, rng: np.random.Generator) -> Gap:
    """Returns a reality gap drawn for a robot.

    Masses, moments of inertia and motors get a factor of 1 + level N each; friction and damping,
    which are known less well, one factor of 1 + 2 level N each for the whole robot; the delay is
    uniform. The same numbers are drawn at every level, so a robot at a wider gap is the same one,
    further from its model.

    Source of the idea, that what a simulation gets wrong be drawn: Jakobi, Husbands and Harvey,
    "Noise and the reality gap" (ECAL 1995).

    Args:
        robot: The robot as its model describes it.
        level: 0 to ``WIDEST``; at 0 every factor is 1.
        rng: Where everything is drawn from.

    Raises:
        InputError: The level is out of range.
    """
    if not 0 <= level <= WIDEST:
        raise InputError(
            f"a reality gap has a level from 0 (none) to {WIDEST}, such as 0.05, got {level}"
        )
    model = robot.model

    def factors(names: list[str]) -> dict[str, float]:
        drawn = _factor(level, rng.standard_normal(len(names)))
        return dict(zip(names, drawn.tolist(), strict=True))

    bodies = [model.body(b).name for b in range(1, model.nbody)]
    mass, inertia = factors(bodies), factors(bodies)
    friction, damping = _factor(2 * level, rng.standard_normal(2)).tolist()
    motors = factors(list(robot.anatomy.motors))
    delay = int(rng.integers(LONGEST_DELAY + 1))
    return Gap(
        level=level,
        mass=mass,
        inertia=inertia,
        friction=friction,
        damping=damping,
        motors=motors,
        delay=delay if level > 0 else 0,
        seed=int(rng.integers(2**63)),
    )


def perturbed(model: mujoco.MjModel, gap: Gap) -> mujoco.MjModel:
    """Returns a copy of a robot's model, as heavy, slippery, damped and strong as the gap says.

    Its layout is the same, so a hypothesis can be worked into it with ``embody``, and such copies
    share a batch. A body or motor that the gap does not name keeps what it has. What is not part
    of a model, the delay and the noise, is not in it.

    Args:
        model: The robot with nothing wrong; it is not changed.
        gap: What is different.
    """
    if gap.level == 0:
        return copy.copy(model)
    names = [model.body(b).name.removeprefix(DEBRIS) for b in range(model.nbody)]
    motors = [model.actuator(k).name for k in range(model.nu)]
    return scale_model(
        model,
        mass=_by_name(gap.mass, names),
        inertia=_by_name(gap.inertia, names),
        friction=gap.friction,
        damping=gap.damping,
        motor_gains=_by_name(gap.motors, motors),
    )


def perturbed_models(
    robot: Robot, shape: Hypothesis, members: int, level: float
) -> tuple[mujoco.MjModel, ...]:
    """Returns models of one robot, each perturbed by a gap of its own.

    The gaps are the same whatever the shape, so that what is compared on the models is compared on
    the same draws.

    Args:
        robot: The robot as its model describes it.
        shape: What reshapes the model; the rest of a hypothesis is for ``embody``.
        members: How many.
        level: Of the gaps.
    """
    rng, model = np.random.default_rng(members), compile_model(robot, shape)
    return tuple(perturbed(model, draw_gap(robot, level, rng)) for _ in range(members))


def _factor(spread: float, normal: FloatArray) -> FloatArray:
    return np.maximum(FLOOR, 1 + spread * normal)


def _by_name(factors: Mapping[str, float], names: list[str]) -> FloatArray:
    """The factor of each name, ``(names,)``; 1 for a name without a factor."""
    return np.array([factors.get(name, 1.0) for name in names])
