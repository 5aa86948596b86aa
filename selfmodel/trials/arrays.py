"""Behaviour of arrays that the caller has measured, with a check of every shape."""

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from selfmodel.arrays import FloatArray, frozen
from selfmodel.errors import InputError, unknown_name
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.signals import SIGNALS, Names, Signal

MAX_TIME_ERROR = 0.5
"""Largest difference of the time of a row from its control step, control time steps."""

MAX_LENGTH_ERROR = 1e-3
"""Largest difference of the length of a quaternion from 1: float32 and printed digits round it."""


class Parts(Protocol):
    """Parts of a robot: its anatomy."""

    @property
    def names(self) -> Names:
        """Column names of the robot's signals."""


class Described(Protocol):
    """Robot of a trial; ``selfmodel.Robot`` is one."""

    @property
    def name(self) -> str:
        """Name of the robot."""

    @property
    def control_timestep(self) -> float:
        """Duration of a control step, s."""

    @property
    def anatomy(self) -> Parts:
        """Parts of the robot."""


def behaviour_of_arrays(
    robot: Described,
    arrays: Mapping[Signal, ArrayLike | None],
    time: ArrayLike | None,
    orders: Mapping[Signal, Sequence[str] | None],
) -> Behaviour:
    """Returns the behaviour of measured arrays; missing signals are NaN.

    Args:
        robot: The robot.
        arrays: Signals, ``(steps, width)`` each; None for a signal that was not measured.
        time: Times of the rows, ``(steps,)`` s; None for rows at every control step.
        orders: Names of the columns of an array, where they are not in the robot's order.

    Raises:
        InputError: An array has another shape, infinite numbers or quaternions that are not of unit
            length, the rows are not control steps, or a name is unknown, missing or listed twice.
    """
    if isinstance(robot, str):
        raise InputError(
            f"expected a robot, got its name {robot!r}: use selfmodel.load_robot({robot!r})"
        )
    names = robot.anatomy.names
    given = {signal: _numbers(signal, values) for signal, values in arrays.items()}
    lengths = {len(values) for values in given.values() if values is not None and values.ndim}
    steps = max(lengths, default=0)
    if steps < 2:
        raise InputError("a trial needs at least two rows of joint_positions and of commands")
    found: dict[Signal, FloatArray] = {}
    for signal in SIGNALS:
        values, width = given.get(signal), names.width(signal)
        if values is None:
            found[signal] = frozen(np.full((steps, width), np.nan))
            continue
        if values.shape != (steps, width):
            raise InputError(
                f"{signal} must have the shape (steps, {_columns(signal)}) = ({steps}, {width}), "
                f"got {values.shape}: its columns are {', '.join(names.columns(signal))}"
            )
        _check_finite(signal, values)
        found[signal] = frozen(_ordered(values, signal, names, orders.get(signal)))
    _check_unit_length(found["base_orientation"])
    _check_time(time, steps, robot.control_timestep)
    scheduled = np.arange(steps, dtype=np.float64) * robot.control_timestep
    return Behaviour(names, frozen(scheduled), found)


def _numbers(signal: str, values: ArrayLike | None) -> FloatArray | None:
    try:
        return None if values is None else np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"{signal} must be an array of numbers, got {type(values).__name__}: {error}"
        ) from error


def _columns(signal: Signal) -> str:
    return {"sensors": "sensors", "commands": "motors"}.get(
        signal, "hinges" if signal.startswith("joint_") else "numbers"
    )


def _ordered(
    values: FloatArray, signal: Signal, names: Names, order: Sequence[str] | None
) -> FloatArray:
    """Columns in the robot's order."""
    known = names.columns(signal)
    if order is None:
        return values
    for name in order:
        if name not in known:
            raise unknown_name(f"column of {signal}", name, known)
    if sorted(order) != sorted(known):
        raise InputError(
            f"the names of the columns of {signal} must be each of {', '.join(known)} once, got "
            f"{', '.join(order)}: correct the list"
        )
    return values[:, [list(order).index(name) for name in known]]


def _check_time(time: ArrayLike | None, steps: int, timestep: float) -> None:
    values = _numbers("time", time)
    if values is None:
        return
    if values.shape != (steps,):
        raise InputError(f"time must have the shape (steps,) = ({steps},), got {values.shape}")
    expected = timestep * np.arange(steps)
    wrong = np.flatnonzero(~(np.abs(values - values[0] - expected) <= MAX_TIME_ERROR * timestep))
    if len(wrong):
        k = int(wrong[0])
        raise InputError(
            f"the rows must be one control time step apart, {timestep:g} s, and row {k} is "
            f"{values[k] - values[0]:g} s after row 0, not {expected[k]:g} s: load the robot with "
            f"the time step of the rows, resample them, or import a file of them with `selfmodel "
            f"logs import`, which resamples"
        )


def _check_finite(signal: str, values: FloatArray) -> None:
    infinite = np.argwhere(np.isinf(values))
    if len(infinite):
        row, column = infinite[0]
        raise InputError(
            f"{signal} has an infinite number in row {row}, column {column}: set what was not "
            f"measured to NaN"
        )


def _check_unit_length(orientations: FloatArray) -> None:
    lengths = np.linalg.norm(orientations, axis=1)
    wrong = np.flatnonzero(np.abs(lengths - 1) > MAX_LENGTH_ERROR)
    if len(wrong):
        raise InputError(
            f"base_orientation must have unit quaternions, w x y z, got one of length "
            f"{lengths[wrong[0]]:g} in row {wrong[0]}: normalise it, or set it to NaN"
        )
