"""Likeness of the commands of two trials: whether the robot walked with the same gait."""

from collections.abc import Sequence

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.trials.trial import Trial

MAX_DIFFERENCE = 0.4
"""Largest difference of the commands of one gait. Recordings of another generator: at most 0.26 for
the same gait, also of a network on a damaged robot, and at least 0.7 for different gaits."""


def have_one_gait(trials: Sequence[Trial], others: Sequence[Trial]) -> bool:
    """Returns whether for each trial one of the others has commands of the same gait.

    Args:
        trials: Trials of a robot.
        others: Other trials of the same robot.
    """
    return all(
        any(command_difference(one, other) <= MAX_DIFFERENCE for other in others) for one in trials
    )


def command_difference(one: Trial, other: Trial) -> float:
    """Returns the difference of the distributions of the commands of two trials.

    It is the mean over the motors of the differences of mean and standard deviation, relative to
    the root mean square of the other trial's standard deviations; infinite without known commands.
    The commands of a network differ in every step, and their distributions hardly.
    """
    first, second = _known(one), _known(other)
    if not len(first) or not len(second):
        return float("inf")
    scale = float(np.sqrt(np.mean(second.var(axis=0))))
    means = np.abs(first.mean(axis=0) - second.mean(axis=0))
    deviations = np.abs(first.std(axis=0) - second.std(axis=0))
    difference = float(np.mean(means + deviations))
    return difference / scale if scale > 0 else (float("inf") if difference > 0 else 0.0)


def _known(trial: Trial) -> FloatArray:
    commands = trial.behaviour["commands"]
    return np.asarray(commands[np.isfinite(commands).all(axis=1)])
