"""How many hidden neurons a robot's network has, as its MJCF says."""

import mujoco

from selfmodel.controllers.network import HIDDEN_NEURONS

NEURONS = "selfmodel_hidden_neurons"
"""The custom numeric of an MJCF that says how many; without it, they are the paper's."""

MAX_HIDDEN_NEURONS = 100
"""Hidden neurons that a network may have: a model may come from somebody's log."""


def hidden_neurons(model: mujoco.MjModel) -> int:
    """Returns how many hidden neurons a model says.

    Raises:
        ValueError: It is no whole number, or too large a one.
    """
    found = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, NEURONS)
    said = float(model.numeric(found).data[0]) if found >= 0 else float(HIDDEN_NEURONS)
    if not (said.is_integer() and 1 <= said <= MAX_HIDDEN_NEURONS):
        raise ValueError(
            f"{NEURONS} must be a whole number from 1 to {MAX_HIDDEN_NEURONS}, got {said}"
        )
    return int(said)


CONTROL_DELAY = "selfmodel_control_delay"
"""The custom numeric of an MJCF that says how many control steps a command takes to its effect."""


MAX_CONTROL_DELAY = 5
"""Control steps that it may say: as many as segments have commands from before their start."""


def control_delay(model: mujoco.MjModel) -> int:
    """Returns the control delay of a model: control steps from a command to its effect.

    Raises:
        ValueError: It is no whole number of steps in the range.
    """
    found = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, CONTROL_DELAY)
    delay = float(model.numeric(found).data[0]) if found >= 0 else 0.0
    if not (delay.is_integer() and 0 <= delay <= MAX_CONTROL_DELAY):
        raise ValueError(
            f"{CONTROL_DELAY} must be a whole number from 0 to {MAX_CONTROL_DELAY}, got {delay:g}"
        )
    return int(delay)
