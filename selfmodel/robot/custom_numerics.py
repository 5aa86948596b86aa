"""Custom numerics of an MJCF: the marks that a calibration writes into a model."""

from typing import TYPE_CHECKING

# Comparators import the limit of the control delay, and need no MuJoCo.
if TYPE_CHECKING:
    from mujoco import MjModel

CONTROL_DELAY = "selfmodel_control_delay"
"""Name of the custom numeric that contains the control delay, in control steps; 0 by default."""

FITTED_CONTACTS = "selfmodel_fitted_contacts"
"""Name of the custom numeric of a model with contacts that a calibration changed."""


def custom_numeric(model: "MjModel", name: str) -> float | None:
    """Returns the first value of a custom numeric; None if the model does not contain it."""
    if name not in (model.numeric(i).name for i in range(model.nnumeric)):
        return None
    return float(model.numeric(name).data[0])
