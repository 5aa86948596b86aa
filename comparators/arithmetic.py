"""The controller's own arithmetic: what it commanded against what its network makes of its input.

No physics is needed to judge it, so a difference means something is wrong with the controller.
"""

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controller import Controller, Population
from selfmodel.trial import Trial


def command_errors(trial: Trial) -> FloatArray:
    """Returns by how much each command differs from what the network gives.

    Args:
        trial: A logged trial.

    Returns:
        ``(steps, motors)`` rad, exactly 0 where the controller did as its network says. From the
        first reading that was not observed on, nothing is known of the network's state: NaN. All 0
        where no controller is known.
    """
    behaviour, driver = trial.behaviour, trial.plan.controller
    commands, readings = behaviour["commands"], behaviour["sensors"]
    if not isinstance(driver, Controller):
        return np.zeros_like(commands)
    network = Population([driver], np.ones((1, driver.network.hidden)))
    errors = np.full_like(commands, np.nan)
    given = np.empty((1, commands.shape[1]))
    for step in range(len(commands)):
        if not np.isfinite(readings[step]).all():
            break
        network.readings[0] = readings[step]
        network.step(given)
        errors[step] = commands[step] - given[0]
    return errors
