"""Reality gap: random differences between a physical robot and its model that are not faults."""

import copy
import dataclasses
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from selfmodel.errors import InputError
from selfmodel.faults.build import compile_model
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.robot.anatomy import Anatomy
from selfmodel.robot.robot import Robot
from selfmodel.simulation.model_factors import scale_model

MAX_GAP_LEVEL = 0.5
"""Largest level: above it, a third of the factors would be at their minimum or implausible."""

MIN_FACTOR = 0.2
"""Smallest factor: masses, motor forces and friction remain positive."""

MAX_EXTRA_DELAY = 2
"""Largest control delay in addition to the model's, control steps."""

DEBRIS_PREFIX = "debris_"
"""Prefix of the names of debris bodies, joints and geoms in a physical robot's model."""


@dataclass(frozen=True)
class RealityGap:
    """One draw of the reality gap, for one physical robot.

    Attributes:
        level: Relative standard deviation of every factor; 0 is no gap.
        mass: Factor of each body's mass, by body name.
        inertia: Factor of each body's principal moments of inertia, by body name.
        friction: Factor of the sliding friction of every geom and contact pair.
        damping: Factor of the damping of every joint.
        motors: Factor of each motor's torque before its limits, by motor name.
        delay: Control delay in addition to the model's, control steps.
        seed: Seed of the measurement noise and of the initial pose of every trial.
    """

    level: float
    mass: Mapping[str, float]
    inertia: Mapping[str, float]
    friction: float
    damping: float
    motors: Mapping[str, float]
    delay: int
    seed: int

    @property
    def text(self) -> str | None:
        """Hidden record of a trial log, as JSON; None for no gap."""
        if self.level == 0:
            return None
        return json.dumps({**dataclasses.asdict(self), "structure": None}, allow_nan=False)


def draw_gap_of(
    model: mujoco.MjModel, anatomy: Anatomy, level: float, rng: np.random.Generator
) -> RealityGap:
    """Returns a random reality gap for a model.

    Every mass, moment of inertia and motor has a factor of 1 + level N. Friction and damping are
    known less precisely: each has one factor of 1 + 2 level N for the whole robot. The delay is
    uniform. The draws do not depend on the level, so two levels with the same random numbers
    describe the same robot at different distances from its model.

    Source of the idea: Jakobi, Husbands and Harvey, "Noise and the reality gap" (ECAL 1995).

    Raises:
        InputError: The level is out of range.
    """
    if not 0 <= level <= MAX_GAP_LEVEL:
        raise InputError(
            f"expected a reality gap with a level from 0 (none) to {MAX_GAP_LEVEL}, such as 0.05, "
            f"got {level}"
        )

    def drawn(spread: float, names: Sequence[str]) -> dict[str, float]:
        factors = np.maximum(MIN_FACTOR, 1 + spread * rng.standard_normal(len(names)))
        return dict(zip(names, factors.tolist(), strict=True))

    bodies = [model.body(b).name for b in range(1, model.nbody)]
    mass, inertia = drawn(level, bodies), drawn(level, bodies)
    friction, damping = drawn(2 * level, ("friction", "damping")).values()
    motors = drawn(level, anatomy.motors)
    delay = int(rng.integers(MAX_EXTRA_DELAY + 1))
    return RealityGap(
        level=level,
        mass=mass,
        inertia=inertia,
        friction=friction,
        damping=damping,
        motors=motors,
        delay=delay if level > 0 else 0,
        seed=int(rng.integers(2**63)),
    )


def perturbed_model(model: mujoco.MjModel, gap: RealityGap) -> mujoco.MjModel:
    """Returns a copy of a robot's model with the masses, friction, damping and motors of a gap.

    A body or motor without a factor in the gap is unchanged.
    """
    if gap.level == 0:
        return copy.copy(model)
    bodies = [model.body(b).name.removeprefix(DEBRIS_PREFIX) for b in range(model.nbody)]
    motors = [model.actuator(k).name for k in range(model.nu)]
    mass, inertia, gains = (
        np.array([factors.get(name, 1.0) for name in names])
        for factors, names in ((gap.mass, bodies), (gap.inertia, bodies), (gap.motors, motors))
    )
    return scale_model(
        model,
        mass=mass,
        inertia=inertia,
        friction=gap.friction,
        damping=gap.damping,
        motor_gains=gains,
    )


def perturbed_models(
    robot: Robot, spec_part: Hypothesis, members: int, level: float
) -> tuple[mujoco.MjModel, ...]:
    """Returns models of one robot, each perturbed by a different gap, whatever the hypothesis.

    Only the faults that edit the model's specification are applied.
    """
    rng, model = np.random.default_rng(members), compile_model(robot, spec_part)
    return tuple(
        perturbed_model(model, draw_gap_of(robot.model, robot.anatomy, level, rng))
        for _ in range(members)
    )
