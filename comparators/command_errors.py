"""Command errors of a trial: logged commands compared with those that its controller computes.

The comparison needs no physics, so a nonzero error is a fault of the controller itself.
"""

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import TARGET_RANGE, make_batch
from selfmodel.controllers.playback import Playback
from selfmodel.trials.trial import Trial


def command_errors(trial: Trial) -> FloatArray:
    """Returns the difference between the logged commands and those of the controller.

    Args:
        trial: A logged trial.

    Returns:
        ``(steps, motors)`` in each motor's unit, exactly 0 where the robot executed its controller.
        NaN from the first reading that was not observed, because the controller's state is unknown
        from there. All 0 for a playback, whose controller is unknown.
    """
    behaviour, source = trial.behaviour, trial.plan.controller
    commands, readings = behaviour["commands"], behaviour["sensors"]
    if isinstance(source, Playback):
        return np.zeros_like(commands)
    batch = make_batch([source], [frozenset()], readings.shape[1])
    errors = np.full_like(commands, np.nan)
    expected = np.empty((1, commands.shape[1]))
    for step in range(len(commands)):
        if not np.isfinite(readings[step]).all():
            break
        batch.readings[0] = readings[step]
        batch.step(expected)
        errors[step] = commands[step] - expected[0]
    return errors


def command_spans(trial: Trial) -> FloatArray:
    """Returns the width of each motor's command range relative to the paper's, ``(motors,)``.

    All 1 for a playback, whose command ranges are unknown.
    """
    source = trial.plan.controller
    if isinstance(source, Playback):
        return np.ones(len(source.motors))
    return np.array([half / TARGET_RANGE for _, half in source.design.ranges])
