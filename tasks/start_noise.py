"""Noise of the initial pose of an episode."""

from selfmodel.errors import InputError
from selfmodel.simulation.initial_pose import ANGLE_DEVIATION
from selfmodel.tasks.arguments import check_number

MAX_START_NOISE = 1.0
"""Largest standard deviation of the initial joint angles, rad."""


def start_level(start_noise: float | None, gap: float) -> float:
    """Returns the noise of the initial pose as a level of the reality gap.

    Args:
        start_noise: Standard deviation of the initial joint angles, rad; None for that of the gap.
        gap: Level of the reality gap.

    Raises:
        InputError: The noise is no number, or out of range.
    """
    if start_noise is None:
        return gap
    check_number("start_noise", start_noise)
    if not 0 <= start_noise <= MAX_START_NOISE:
        raise InputError(
            f"expected a start_noise from 0 to {MAX_START_NOISE:g} rad, such as 0.02, got "
            f"{start_noise}"
        )
    return start_noise / ANGLE_DEVIATION
