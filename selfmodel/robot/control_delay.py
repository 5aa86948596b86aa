"""Control delay of a robot: time from a command to its effect, in control steps.

A control delay may be a part of a control step, as long as it is a whole number of physics steps.

A calibration writes the control delay into the MJCF, as a custom numeric. Logs of version 0.1 may
contain a further custom numeric, ``selfmodel_hidden_neurons``. Readers ignore it: the controller in
the log contains the number of hidden neurons.
"""

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mujoco import MjModel


# Comparators import the limit, and need no MuJoCo.

MAX_CONTROL_DELAY = 5
"""Largest control delay, in control steps: segments contain that many commands before their
start."""

_TOLERANCE = 1e-4
"""Rounding error of a control delay in an MJCF of six digits, in physics steps."""


def control_delay(model: "MjModel", substeps: int) -> float:
    """Returns the control delay of a model, in control steps.

    Args:
        model: A compiled model.
        substeps: Physics steps per control step.

    Returns:
        A multiple of ``1 / substeps``; an ``int`` if it is a whole number of control steps.

    Raises:
        ValueError: The custom numeric is not from 0 to ``MAX_CONTROL_DELAY``, not a whole number of
            physics steps, or not a whole number of control steps in a model with activations.
    """
    delay = custom_numeric(model, CONTROL_DELAY) or 0.0
    allowed = 1 if model.na else substeps
    if not 0 <= delay <= MAX_CONTROL_DELAY or abs(delay * allowed - round(delay * allowed)) > (
        _TOLERANCE
    ):
        parts = "a whole number" if allowed == 1 else f"a multiple of 1/{allowed}"
        raise ValueError(
            f"{CONTROL_DELAY} must be {parts} from 0 to {MAX_CONTROL_DELAY}, got {delay:g}"
        )
    return as_delay(round(delay * allowed), allowed)


def as_delay(parts: int, substeps: int) -> float:
    """Returns a control delay in control steps; an ``int`` if it is a whole number of them.

    Args:
        parts: The control delay in physics steps.
        substeps: Physics steps per control step.
    """
    return parts // substeps if parts % substeps == 0 else parts / substeps


def split_delay(delay: float, substeps: int) -> tuple[int, int]:
    """Returns a control delay as whole control steps and the physics steps beyond them.

    Args:
        delay: Control delay, in control steps.
        substeps: Physics steps per control step.
    """
    return divmod(round(delay * substeps), substeps)


def added_steps(delay: float, added: float) -> int:
    """Returns the whole control steps by which a control delay grows under a fault.

    Args:
        delay: Control delay of the healthy robot, in control steps.
        added: Severity of the fault, in control steps; rounded, and limited so that the sum is at
            most ``MAX_CONTROL_DELAY``.
    """
    return min(round(added), math.floor(MAX_CONTROL_DELAY - delay))


# Comparators import the limit of the control delay, and need no MuJoCo.

CONTROL_DELAY = "selfmodel_control_delay"
"""Name of the custom numeric that contains the control delay, in control steps; 0 by default."""

FITTED_CONTACTS = "selfmodel_fitted_contacts"
"""Name of the custom numeric of a model with contacts that a calibration changed."""


def custom_numeric(model: "MjModel", name: str) -> float | None:
    """Returns the first value of a custom numeric; None if the model does not contain it."""
    if name not in (model.numeric(i).name for i in range(model.nnumeric)):
        return None
    return float(model.numeric(name).data[0])
