"""Names of ``anatomy``, until their importers are changed."""

from selfmodel.robot.anatomy import (
    CONTROL_DELAY,
    FITTED_CONTACTS,
    MAX_CONTROL_DELAY,
    added_steps,
    as_delay,
    control_delay,
    custom_numeric,
    split_delay,
)

__all__ = [
    "CONTROL_DELAY",
    "FITTED_CONTACTS",
    "MAX_CONTROL_DELAY",
    "added_steps",
    "as_delay",
    "control_delay",
    "custom_numeric",
    "split_delay",
]
