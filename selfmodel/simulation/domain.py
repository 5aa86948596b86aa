"""Domain randomisation: draws of everything that trials leave open about a robot.

A controller that is evolved in one exact simulation depends on its exactness. Rollouts under
several domain samples measure how a controller performs on a robot that is only known
approximately.
Source of the idea: Jakobi, Husbands and Harvey, "Noise and the reality gap" (ECAL 1995).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import mujoco
import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.robot.anatomy import Anatomy
from selfmodel.robot.anatomy_reader import joint_limits
from selfmodel.robot.model_variant import WELD_ARMATURE, ModelVariant
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import (
    BASE_SIGNALS,
    bind_data,
    current_value,
    signal_fields,
    state_writer,
)
from selfmodel.rotation import product
from selfmodel.simulation.model_factors import ModelDistribution, Parameters, model_with_parameters
from selfmodel.trials.signals import MEASUREMENT_FULL_SCALES, SIGNALS

ANGLE_DEVIATION, TILT_DEVIATION = 0.2, 0.1
"""Standard deviations of the initial joint angles, and of the initial roll and pitch of the base,
rad, at a gap level of 1."""

DRAWN_STEPS = 50
"""Control steps of which the noise is drawn at once."""


@dataclass(frozen=True)
class StartSpread:
    """Standard deviations of initial poses from the reference pose of a model.

    They are those of the joint angles, of the roll and the pitch of the base, and of its heading,
    rad.
    """

    angles: float
    tilt: float
    heading: float = 0.0


NO_SPREAD = StartSpread(0.0, 0.0)


def start_spread(level: float) -> StartSpread:
    """Returns the spread of the initial poses of a physical robot at a level of the gap."""
    return StartSpread(level * ANGLE_DEVIATION, level * TILT_DEVIATION)


@dataclass(frozen=True, eq=False)
class DomainDistribution:
    """Distribution of the runs of a robot around those of its self-model.

    Attributes:
        reading_noise: Standard deviation of the noise of each reading, ``(sensors,)``.
        wrong_touches: Probability that a touch reading is wrong, ``(sensors,)``; 0 for others.
        delays: Control delays in addition to the self-model's, control steps, equally probable.
    """

    models: ModelDistribution
    reading_noise: FloatArray
    wrong_touches: FloatArray
    start: StartSpread
    delays: tuple[int, ...] = (0,)

    @property
    def is_none(self) -> bool:
        """Whether all runs equal those of the self-model."""
        noise = self.reading_noise.any() or self.wrong_touches.any() or self.start != NO_SPREAD
        return self.models.is_exact and not noise and self.delays == (0,)


@dataclass(frozen=True, eq=False)
class DomainSample:
    """One draw of a domain: the condition of a run.

    Attributes:
        delay: Control delay in addition to the self-model's, control steps.
        seed: Seed of the initial pose, of the noise of the readings, and of the random parts of
            faults, such as terrain; None for the self-model itself.
    """

    hypothesis: Hypothesis
    model: Parameters
    delay: int
    seed: int | None

    def variant(self, robot: Robot) -> ModelVariant:
        """Returns the model and sensor parameters of a robot, given its self-model."""
        perturb = partial(model_with_parameters, robot, self.model)
        variant = build(robot, self.hypothesis, self.seed or 0, perturb=perturb)
        variant.added_delay[0] += self.delay
        return variant


def draw_samples(
    hypotheses: Sequence[Hypothesis],
    uncertainty: DomainDistribution,
    count: int,
    rng: np.random.Generator,
) -> tuple[DomainSample, ...]:
    """Returns random conditions, with indistinguishable hypotheses in turn from a random one."""
    first = int(rng.integers(len(hypotheses)))
    certain = uncertainty.is_none
    return tuple(
        DomainSample(
            hypotheses[(first + number) % len(hypotheses)],
            uncertainty.models.draw(rng),
            int(rng.choice(uncertainty.delays)),
            None if certain else int(rng.integers(2**63)),
        )
        for number in range(count)
    )


def initial_positions(
    robot: Robot,
    variants: Sequence[ModelVariant],
    conditions: Sequence[DomainSample],
    spread: StartSpread,
) -> FloatArray:
    """Returns the initial generalised positions of a robot, ``(conditions, nq)``."""
    states = [mujoco.MjData(variant.model) for variant in variants]
    if spread != NO_SPREAD:
        for data, condition in zip(states, conditions, strict=True):
            rng = np.random.default_rng((condition.seed or 0, 0))
            randomize_initial_pose(robot, data, spread, rng)
    return np.array([data.qpos for data in states])


def randomize_initial_pose(
    robot: Robot, data: mujoco.MjData, spread: StartSpread, rng: np.random.Generator
) -> None:
    """Moves a robot from its reference pose to a random pose nearby, above the ground.

    Joint angles stay within their limits. Welded joints are unchanged, and so are degrees of
    freedom that the base does not have, such as the tilt of a planar base. ``data`` is the
    reference pose of the robot with its faults.
    """
    model = data.model
    fields, write = signal_fields(robot, model), state_writer(robot, bind_data(data), model)
    reference_depth = _penetration_depth(robot, data)
    randomize_joint_angles(robot.anatomy, model, data, spread.angles, rng)
    tilt = np.append(spread.tilt * rng.standard_normal(2), 0.0)
    if spread.heading:
        tilt[2] = spread.heading * rng.standard_normal()
    base = rotated_by_vector(current_value(fields["base_orientation"], data), tilt)
    write({"base_orientation": base[np.newaxis]})
    # Penetration no deeper than in the reference pose: deeper contacts would throw the robot up.
    depth = _penetration_depth(robot, data)
    lift = [0.0, 0.0, max(0.0, depth - reference_depth)]
    write({"base_position": (current_value(fields["base_position"], data) + lift)[np.newaxis]})


def randomize_joint_angles(
    anatomy: Anatomy,
    model: mujoco.MjModel,
    data: mujoco.MjData,
    deviation: float,
    rng: np.random.Generator,
) -> None:
    """Adds normal noise (rad) to the joint angles within their limits, but for welded joints."""
    angles = deviation * rng.standard_normal(len(anatomy.hinges))
    for name, angle in zip(anatomy.hinges, angles, strict=True):
        if not _is_welded(model, name):
            hinge = model.joint(name)
            address, moved = hinge.qposadr[0], data.qpos[hinge.qposadr[0]] + angle
            data.qpos[address] = np.clip(moved, *hinge.range) if hinge.limited[0] else moved


def _is_welded(model: mujoco.MjModel, hinge: str) -> bool:
    return bool(model.dof_armature[model.joint(hinge).dofadr[0]] == WELD_ARMATURE)


def _penetration_depth(robot: Robot, data: mujoco.MjData) -> float:
    """Returns the depth of the robot's deepest contact with the world, m; 0 without a contact.

    It is negative for a contact within its margin.
    """
    model = data.model
    mujoco.mj_fwdPosition(model, data)
    root = model.body(robot.root).id
    roots = model.body_rootid[model.geom_bodyid[data.contact.geom]]
    # The world and the robot, in either order.
    depths = -data.contact.dist[(roots == root).any(axis=1) & (roots == 0).any(axis=1)]
    return float(depths.max()) if len(depths) else 0.0


def rotated_by_vector(orientation: FloatArray, vector: FloatArray) -> FloatArray:
    """Returns an orientation (w x y z) rotated by a rotation vector in the body frame, rad."""
    rotation, result = np.array([1.0, 0, 0, 0]), np.empty(4)
    mujoco.mju_quatIntegrate(rotation, vector, 1.0)
    mujoco.mju_mulQuat(result, orientation, rotation)
    mujoco.mju_normalize4(result)
    return result


def measurement_noise(
    robot: Robot,
    variants: Sequence[ModelVariant],
    conditions: Sequence[DomainSample],
    uncertainty: DomainDistribution,
) -> Callable[[FloatArray, Mapping[str, FloatArray]], None]:
    """Returns a function that adds the noise of the next step to what controllers observe.

    These are readings, ``(runs, sensors)``, and other signals, ``(runs, width)`` each, whose level
    of noise is the largest of the readings'. The noise of a condition is the same in all its runs
    (common random numbers); dead sensors have none. The runs of the conditions are in turn in each
    group of adjacent rows.
    """
    anatomy = robot.anatomy
    silent = np.array([dead_sensors(anatomy, variant) for variant in variants])
    generators = [np.random.default_rng((own.seed or 0, 1)) for own in conditions]
    deviations = np.where(silent, 0.0, uncertainty.reading_noise)
    wrong_touches = np.where(silent, 0.0, uncertainty.wrong_touches)
    count, sensors = silent.shape
    # Without a sensor of an angle, the level is that of the initial poses.
    angles = uncertainty.reading_noise.max(initial=0.0)
    level = float(angles or uncertainty.start.angles / ANGLE_DEVIATION)
    of_signals = [np.random.default_rng((own.seed or 0, 2)) for own in conditions]
    half_ranges = joint_half_ranges(robot)
    # The pose of a fixed base is known, so no sensor measures it.
    known = BASE_SIGNALS if robot.has_fixed_base else ()
    drawn: list[FloatArray] = []  # standard noise of the next steps, the next one last

    def add(readings: FloatArray, observed: Mapping[str, FloatArray]) -> None:
        by_condition = readings.reshape(len(readings) // count, count, sensors)
        uniform = np.array([rng.random(sensors) for rng in generators])
        normal = np.array([rng.standard_normal(sensors) for rng in generators])
        by_condition += deviations * normal
        wrong = uniform < wrong_touches
        by_condition[:, wrong] = 1 - by_condition[:, wrong]
        noisy = [one for one in SIGNALS if level and one in observed and one not in known]
        turned = "base_orientation"
        widths = [3 if one == turned else observed[one].shape[1] for one in noisy]
        if noisy and not drawn:
            shape = (DRAWN_STEPS, sum(widths))
            drawn.extend(np.stack([rng.standard_normal(shape) for rng in of_signals], axis=1)[::-1])
        parts = np.split(drawn.pop(), np.cumsum(widths)[:-1], axis=1) if noisy else []
        for signal, own in zip(noisy, parts, strict=True):
            rows, joints = observed[signal], signal == "joint_positions"
            scale = level * (half_ranges if joints else MEASUREMENT_FULL_SCALES[signal])
            noise = np.tile(scale * own, (len(rows) // count, 1))
            if signal == turned:
                turn = np.column_stack([np.ones(len(noise)), noise / 2])
                rows[:] = product(rows, turn / np.linalg.norm(turn, axis=1, keepdims=True))
            else:
                rows += noise

    return add


def joint_half_ranges(robot: Robot) -> FloatArray:
    """Returns half the range of each hinge, ``(hinges,)``, rad: full scale of its position."""
    hinges = [robot.model.joint(name).id for name in robot.anatomy.hinges]
    # MuJoCo leaves the range of an unlimited hinge in degrees, if the MJCF is in degrees.
    ranges = [joint_limits(robot.model, hinge) for hinge in hinges]
    return np.array([(high - low) / 2 for low, high in ranges])


def dead_sensors(anatomy: Anatomy, variant: ModelVariant) -> BoolArray:
    """Returns a mask of the sensors without any signal, ``(sensors,)``.

    The sensor of a joint that is welded at 0 reads 0 too, but is not dead.
    """
    welded = [
        bool(sensor.hinge) and _is_welded(variant.model, sensor.hinge) for sensor in anatomy.sensors
    ]
    silent = (variant.gain == 0) & (variant.offset == 0)
    return np.asarray(silent & ~np.array(welded, dtype=bool))
