"""Domain randomisation: draws of everything that trials leave open about a robot.

A controller that is evolved in one exact simulation depends on its exactness. Rollouts under
several domain samples measure how a controller performs on a robot that is only known
approximately.
Source of the idea: Jakobi, Husbands and Harvey, "Noise and the reality gap" (ECAL 1995).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import mujoco
import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.robot.anatomy import Anatomy
from selfmodel.robot.embodiment import WELD_ARMATURE, Embodiment
from selfmodel.robot.robot import Robot
from selfmodel.simulation.initial_pose import StartSpread, randomize_initial_pose
from selfmodel.simulation.model_factors import (
    ModelDistribution,
    Parameters,
    model_with_parameters,
)

_SEEDS = 2**63


@dataclass(frozen=True, eq=False)
class DomainDistribution:
    """Distribution of the runs of a robot around those of its self-model.

    Attributes:
        models: Distribution of the parameters of the model.
        reading_noise: Standard deviation of the noise of each reading, ``(sensors,)``; 0 for a
            touch sensor.
        wrong_touches: Probability that a reading of a touch sensor is wrong, ``(sensors,)``; 0 for
            other sensors.
        start: Spread of the initial poses.
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


NO_SPREAD = StartSpread(0.0, 0.0)


@dataclass(frozen=True, eq=False)
class DomainSample:
    """One draw of a domain: the condition of a run.

    Attributes:
        hypothesis: Faults of the robot.
        model: Parameters of the model.
        delay: Control delay in addition to the self-model's, control steps.
        seed: Seed of the initial pose, of the noise of the readings, and of the random parts of
            faults, such as terrain; None for the self-model itself.
    """

    hypothesis: Hypothesis
    model: Parameters
    delay: int
    seed: int | None

    def embodiment(self, robot: Robot) -> Embodiment:
        """Returns the model and sensor parameters of a robot, given its self-model."""
        perturb = partial(model_with_parameters, robot, self.model)
        embodiment = build(robot, self.hypothesis, self.seed or 0, perturb=perturb)
        embodiment.added_delay[0] += self.delay
        return embodiment


def draw_samples(
    hypotheses: Sequence[Hypothesis],
    uncertainty: DomainDistribution,
    count: int,
    rng: np.random.Generator,
) -> tuple[DomainSample, ...]:
    """Returns random conditions, with the hypotheses in turn from a random one.

    Args:
        hypotheses: Indistinguishable hypotheses, at least one.
        uncertainty: Distribution of the conditions.
        count: Number of conditions.
        rng: Random number generator of the draws.
    """
    first = int(rng.integers(len(hypotheses)))
    certain = uncertainty.is_none
    return tuple(
        DomainSample(
            hypotheses[(first + number) % len(hypotheses)],
            uncertainty.models.draw(rng),
            int(rng.choice(uncertainty.delays)),
            None if certain else int(rng.integers(_SEEDS)),
        )
        for number in range(count)
    )


def initial_positions(
    robot: Robot,
    embodiments: Sequence[Embodiment],
    conditions: Sequence[DomainSample],
    spread: StartSpread,
) -> FloatArray:
    """Returns the initial generalised positions of a robot, ``(conditions, nq)``.

    Args:
        robot: The robot as its model describes it.
        embodiments: Model of the robot under each condition.
        conditions: The conditions.
        spread: Spread of the initial poses.
    """
    poses = []
    for embodiment, condition in zip(embodiments, conditions, strict=True):
        data = mujoco.MjData(embodiment.model)
        if spread != NO_SPREAD:
            rng = np.random.default_rng((condition.seed or 0, 0))
            randomize_initial_pose(robot, embodiment.model, data, spread, rng)
        poses.append(data.qpos.copy())
    return np.array(poses)


class ReadingNoise:
    """Adds noise to the readings of a batch of runs, by condition, step by step.

    The noise of a condition is the same in all its runs (common random numbers).

    Args:
        anatomy: Parts of the robot.
        embodiments: The robot under each condition; its dead sensors have no noise.
        conditions: The conditions, whose runs are in turn in each group of adjacent rows.
        uncertainty: Distribution of the noise.
    """

    def __init__(
        self,
        anatomy: Anatomy,
        embodiments: Sequence[Embodiment],
        conditions: Sequence[DomainSample],
        uncertainty: DomainDistribution,
    ) -> None:
        silent = np.array([dead_sensors(anatomy, own) for own in embodiments])
        self._generators = [np.random.default_rng((own.seed or 0, 1)) for own in conditions]
        self._deviations = np.where(silent, 0.0, uncertainty.reading_noise)
        self._wrong = np.where(silent, 0.0, uncertainty.wrong_touches)

    def add(self, readings: FloatArray) -> None:
        """Adds the noise of the next step to the readings, ``(runs * conditions, sensors)``."""
        count, sensors = self._deviations.shape
        by_condition = readings.reshape(len(readings) // count, count, sensors)
        uniform = np.array([rng.random(sensors) for rng in self._generators])
        normal = np.array([rng.standard_normal(sensors) for rng in self._generators])
        by_condition += self._deviations * normal
        wrong = uniform < self._wrong
        by_condition[:, wrong] = 1 - by_condition[:, wrong]


def dead_sensors(anatomy: Anatomy, embodiment: Embodiment) -> BoolArray:
    """Returns a mask of the sensors without any signal, ``(sensors,)``.

    The sensor of a joint that is welded at 0 reads 0 too, but is not dead.
    """
    model = embodiment.model
    welded = [
        bool(sensor.hinge)
        and bool(model.dof_armature[model.joint(sensor.hinge).dofadr[0]] == WELD_ARMATURE)
        for sensor in anatomy.sensors
    ]
    silent = (embodiment.gain == 0) & (embodiment.offset == 0)
    return np.asarray(silent & ~np.array(welded, dtype=bool))
