"""Custom numerics that selfmodel writes into an MJCF: the control delay.

Logs of version 0.1 may contain a further one, ``selfmodel_hidden_neurons``. Readers ignore it:
the controller in the log contains the number of hidden neurons.
"""

import mujoco

from selfmodel.robot.control_delay import MAX_CONTROL_DELAY

CONTROL_DELAY = "selfmodel_control_delay"
"""Name of the custom numeric that contains the control delay, in control steps; 0 by default."""


def control_delay(model: mujoco.MjModel) -> int:
    """Returns the control delay of a model: control steps from a command to its effect.

    Raises:
        ValueError: The custom numeric is not a whole number from 0 to ``MAX_CONTROL_DELAY``.
    """
    index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, CONTROL_DELAY)
    delay = float(model.numeric(index).data[0]) if index >= 0 else 0.0
    if not (delay.is_integer() and 0 <= delay <= MAX_CONTROL_DELAY):
        raise ValueError(
            f"{CONTROL_DELAY} must be a whole number from 0 to {MAX_CONTROL_DELAY}, got {delay:g}"
        )
    return int(delay)
