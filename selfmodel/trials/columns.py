"""Columns of a trial as a table: one name per number, as ``logs export`` writes them."""

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.signals import Names, Signal

TIME = "time"
"""Name of the time column, s."""

PREFIXES: Mapping[Signal, str] = MappingProxyType(
    {
        "joint_positions": "position",
        "joint_velocities": "velocity",
        "joint_efforts": "effort",
        "commands": "command",
        "sensors": "sensor",
        "base_position": "base_position",
        "base_orientation": "base_orientation",
        "base_linear_velocity": "base_linear_velocity",
        "base_angular_velocity": "base_angular_velocity",
    }
)
"""First part of the name of each signal's columns: ``position.front_left_knee``."""


def column_names(names: Names, signal: Signal) -> tuple[str, ...]:
    """Returns the names of a signal's columns in a table."""
    return tuple(f"{PREFIXES[signal]}.{name}" for name in names.columns(signal))


def columns_of(behaviour: Behaviour) -> dict[str, FloatArray]:
    """Returns the columns of a behaviour by name, time first.

    A joint, motor or sensor without any number has no column, and so the base's vectors.

    Args:
        behaviour: Behaviour of one run.

    Returns:
        Columns, ``(steps,)`` each, in the unit of their signal.
    """
    found: dict[str, FloatArray] = {TIME: behaviour.time}
    for signal in PREFIXES:
        if signal not in behaviour.signals:
            continue
        values = behaviour[signal]
        unknown = np.isnan(values)
        absent = unknown.all(axis=None if signal.startswith("base_") else 0)
        absent = np.broadcast_to(absent, values.shape[1:])
        for k, name in enumerate(column_names(behaviour.names, signal)):
            if not absent[k]:
                found[name] = values[:, k]
    return found
