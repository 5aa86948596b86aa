"""The controller's own arithmetic: what it commanded against what it makes of its input.

No physics is needed to judge it, so a difference means something is wrong with the controller.
"""

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.command_range import TARGET_RANGE
from selfmodel.controllers.driver import drive
from selfmodel.controllers.playback import Playback
from selfmodel.trials.trial import Trial


def command_errors(trial: Trial) -> FloatArray:
    """Returns by how much each command differs from what the controller gives.

    Args:
        trial: A logged trial.

    Returns:
        ``(steps, motors)`` in each motor's unit, exactly 0 where the robot did as its controller
        says. From the first reading that was not observed on, nothing is known of the controller's
        state: NaN. All 0 where no controller is known.
    """
    behaviour, driver = trial.behaviour, trial.plan.controller
    commands, readings = behaviour["commands"], behaviour["sensors"]
    if isinstance(driver, Playback):
        return np.zeros_like(commands)
    whole = np.ones((1, 0))  # no neuron of it is silent
    brain = drive([driver], whole, readings.shape[1])
    errors = np.full_like(commands, np.nan)
    given = np.empty((1, commands.shape[1]))
    for step in range(len(commands)):
        if not np.isfinite(readings[step]).all():
            break
        brain.readings[0] = readings[step]
        brain.step(given)
        errors[step] = commands[step] - given[0]
    return errors


def command_spans(trial: Trial) -> FloatArray:
    """Returns how wide each motor's command range is beside the paper's, ``(motors,)``.

    All 1 where no controller is known.
    """
    driver = trial.plan.controller
    if isinstance(driver, Playback):
        return np.ones(len(driver.motors))
    return np.array([half / TARGET_RANGE for _, half in driver.design.ranges])
