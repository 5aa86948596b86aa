"""Evaluation of gaits for a repertoire: score and duty factors of each rollout."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Controller
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.recovery.falls import falls_of
from selfmodel.robot.anatomy import Anatomy
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import forward_displacement
from selfmodel.trials.signals import Signal

Evaluate = Callable[[Sequence[Controller]], tuple[FloatArray, FloatArray]]
"""Function that evaluates gaits: scores, ``(n,)``, with negative infinity for a gait that may not
enter a repertoire, and duty factors, ``(n, feet)``."""

MAX_BATCH = 200
"""Rollouts in one batch of the simulator: more take memory and no less time."""

RECORD: tuple[Signal, ...] = ("base_position", "base_orientation", "sensors")


def feet_of(anatomy: Anatomy) -> tuple[str, ...]:
    """Returns the names of the touch sensors, one per foot.

    Raises:
        InputError: The robot has no touch sensors.
    """
    feet = tuple(sensor.name for sensor in anatomy.sensors if sensor.kind == "touch")
    if not feet:
        raise InputError(
            "a repertoire needs the touch sensors of feet, and this robot has none: add sites "
            "with <touch> sensors to the feet in its MJCF, or choose another search"
        )
    return feet


def duty_factors(anatomy: Anatomy, readings: FloatArray) -> FloatArray:
    """Returns the duty factor of each foot: the fraction of the steps with ground contact.

    Source: A. Cully, J. Clune, D. Tarapore and J.-B. Mouret, *Robots that can adapt like animals*
    (Nature 521:503, 2015), Methods: the behavioural descriptor of the hexapod.

    Args:
        anatomy: Parts of the robot.
        readings: Readings of all sensors, ``(..., steps, sensors)``; touch is 0 or 1.

    Returns:
        ``(..., feet)``, each 0 to 1.
    """
    touch = [k for k, sensor in enumerate(anatomy.sensors) if sensor.kind == "touch"]
    return np.asarray(readings[..., touch].mean(axis=-2))


def simulated_evaluation(simulator: Simulator, hypothesis: Hypothesis, steps: int) -> Evaluate:
    """Returns the evaluation of gaits by their forward displacement in simulation, m.

    The score is negative infinity for a gait that falls, diverges, or does not move forward.

    Args:
        simulator: Self-model.
        hypothesis: Faults of the simulated robot.
        steps: Control steps of a rollout.

    Raises:
        InputError: The robot has no touch sensors.
    """
    feet_of(simulator.robot.anatomy)
    return partial(_evaluate, simulator, hypothesis, steps)


def _evaluate(
    simulator: Simulator, hypothesis: Hypothesis, steps: int, controllers: Sequence[Controller]
) -> tuple[FloatArray, FloatArray]:
    robot, found = simulator.robot, []
    for start in range(0, len(controllers), MAX_BATCH):
        batch = controllers[start : start + MAX_BATCH]
        result = simulator.run([(hypothesis, one) for one in batch], steps, RECORD)
        scores = np.array(forward_displacement(result.behaviour))
        falls = falls_of(robot, hypothesis, result.behaviour) < steps
        scores[result.diverged | falls | ~(scores > 0)] = -np.inf
        found.append((scores, duty_factors(robot.anatomy, result.behaviour["sensors"])))
    return np.concatenate([one for one, _ in found]), np.concatenate([two for _, two in found])
