"""Falls of a robot, from the pose of its base."""

import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.rotation import directions

FALLEN_HEIGHT = 0.5
"""Height below which a base has fallen, as a fraction of its standing height. A base that starts on
the ground, as a swimmer's, cannot fall by this rule."""

FALLEN_TILT = np.radians(60)
"""Tilt above which a base has fallen, relative to its initial orientation, rad."""


def first_falls(behaviour: Behaviour, normals: FloatArray, standing_height: float) -> IndexArray:
    """Returns the first step at which the robot has fallen, or the number of steps without a fall.

    Args:
        behaviour: Position and orientation of the base, ``(..., steps, width)`` each.
        normals: Unit normals of the ground, ``(..., 3)``, broadcast to the shape of the runs. The
            ground passes through the origin.
        standing_height: Height of the base in the initial pose, m.

    Returns:
        Step indices, ``(...)``.
    """
    height = np.einsum("...sk,...k->...s", behaviour["base_position"], normals)
    upward = directions(behaviour["base_orientation"])[..., 2:]  # world's up, in the base frame
    # Cosine of the tilt.
    upright = (upward * upward[..., :1, :]).sum(axis=-1)
    low = (height < FALLEN_HEIGHT * standing_height) & (standing_height > 0)
    fallen = low | (upright < np.cos(FALLEN_TILT))
    return np.where(fallen.any(axis=-1), fallen.argmax(axis=-1), behaviour.steps)
