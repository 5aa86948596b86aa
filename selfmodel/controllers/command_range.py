"""Command ranges of motors, and outputs in [-1, 1] scaled to them."""

import math

import numpy as np

from selfmodel.arrays import FloatArray

TARGET_RANGE = np.pi / 4
"""The paper's motor targets span plus and minus this angle, rad."""


Ranges = tuple[tuple[float, float], ...]
"""Of each motor the centre of what it is commanded, and half the range, in the motor's own unit:
rad for a position servo, rad/s for a velocity servo, a part of its torque for many a motor."""


def checked_ranges(motors: tuple[str, ...], ranges: Ranges) -> Ranges:
    """Returns the command ranges of some motors, the paper's for all where none is given.

    Raises:
        ValueError: They do not fit the motors, or one is not finite or has no width.
    """
    if not ranges:
        return ((0.0, TARGET_RANGE),) * len(motors)
    if len(ranges) != len(motors):
        raise ValueError(f"{len(motors)} motors need a command range each, got {len(ranges)}")
    for motor, (centre, half) in zip(motors, ranges, strict=True):
        if not (math.isfinite(centre) and math.isfinite(half) and half > 0):
            raise ValueError(
                f"the motor {motor} needs a finite command range of some width, got "
                f"{centre} plus and minus {half}"
            )
    return ranges


class Commands:
    """Turns outputs in [-1, 1] into the commands of many robots of the same motors.

    Args:
        ranges: What each motor is commanded.
    """

    def __init__(self, ranges: Ranges) -> None:
        self._half = np.array([half for _, half in ranges])
        centre = np.array([middle for middle, _ in ranges])
        self._centre = centre if centre.any() else None

    def write(self, outputs: FloatArray, commands: FloatArray) -> None:
        """Writes the commands, ``(n, motors)``, for outputs of that shape."""
        np.multiply(outputs, self._half, out=commands)
        if self._centre is not None:
            commands += self._centre
