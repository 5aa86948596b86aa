"""Control delay of a robot: control steps from a command to its effect.

A calibration writes the control delay into the MJCF, as a custom numeric. Logs of version 0.1 may
contain a further custom numeric, ``selfmodel_hidden_neurons``. Readers ignore it: the controller in
the log contains the number of hidden neurons.
"""

from typing import TYPE_CHECKING

# Comparators import the limit, and need no MuJoCo.
if TYPE_CHECKING:
    from mujoco import MjModel

MAX_CONTROL_DELAY = 5
"""Largest control delay, in control steps: segments contain that many commands before their
start."""

CONTROL_DELAY = "selfmodel_control_delay"
"""Name of the custom numeric that contains the control delay, in control steps; 0 by default."""


def control_delay(model: "MjModel") -> int:
    """Returns the control delay of a model.

    Raises:
        ValueError: The custom numeric is not a whole number from 0 to ``MAX_CONTROL_DELAY``.
    """
    delay = float(model.numeric(CONTROL_DELAY).data[0]) if has_control_delay(model) else 0.0
    if not (delay.is_integer() and 0 <= delay <= MAX_CONTROL_DELAY):
        raise ValueError(
            f"{CONTROL_DELAY} must be a whole number from 0 to {MAX_CONTROL_DELAY}, got {delay:g}"
        )
    return int(delay)


def has_control_delay(model: "MjModel") -> bool:
    """Returns whether a model contains the custom numeric of the control delay."""
    return CONTROL_DELAY in (model.numeric(i).name for i in range(model.nnumeric))
