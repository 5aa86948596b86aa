"""Command ranges of motors, and the scaling of controller outputs to them."""

import math

import numpy as np

from selfmodel.arrays import FloatArray

TARGET_RANGE = np.pi / 4
"""Half range of the paper's motor targets about 0, rad."""


Ranges = tuple[tuple[float, float], ...]
"""Centre and half width of the command range per motor, in the motor's unit: rad for a position
servo, rad/s for a velocity servo, a fraction of the largest torque for many torque motors."""


def checked_ranges(motors: tuple[str, ...], ranges: Ranges) -> Ranges:
    """Returns checked command ranges; the paper's range for every motor if ``ranges`` is empty.

    Raises:
        ValueError: The number of ranges is not the number of motors, or a range is not finite or
            has no positive width.
    """
    if not ranges:
        return ((0.0, TARGET_RANGE),) * len(motors)
    if len(ranges) != len(motors):
        raise ValueError(f"{len(motors)} motors need a command range each, got {len(ranges)}")
    for motor, (centre, half) in zip(motors, ranges, strict=True):
        if not (math.isfinite(centre) and math.isfinite(half) and half > 0):
            raise ValueError(
                f"the motor {motor} needs a finite command range of positive width, got "
                f"{centre} plus and minus {half}"
            )
    return ranges


class CommandScaler:
    """Scales outputs in [-1, 1] to the command ranges of the motors.

    Args:
        ranges: Command range of each motor.
    """

    def __init__(self, ranges: Ranges) -> None:
        self._half = np.array([half for _, half in ranges])
        centre = np.array([middle for middle, _ in ranges])
        self._centre = centre if centre.any() else None

    def write(self, outputs: FloatArray, commands: FloatArray) -> None:
        """Writes the commands for outputs in [-1, 1]; both arrays are ``(n, motors)``."""
        np.multiply(outputs, self._half, out=commands)
        if self._centre is not None:
            commands += self._centre
