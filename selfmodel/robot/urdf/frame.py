"""Frames of links, joints and geoms in each other."""

from dataclasses import dataclass

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.robot.mjcf.document.expand import format_numbers


@dataclass(frozen=True)
class Frame:
    """A frame in another frame.

    Attributes:
        position: ``(3,)``, m.
        orientation: ``(4,)``, unit quaternion.
    """

    position: FloatArray
    orientation: FloatArray

    def then(self, inner: "Frame") -> "Frame":
        """Returns a frame that is given in this frame, in the outer frame."""
        position, orientation = np.empty(3), np.empty(4)
        mujoco.mju_rotVecQuat(position, inner.position, self.orientation)
        mujoco.mju_mulQuat(orientation, self.orientation, inner.orientation)
        return Frame(self.position + position, orientation)

    def inverse(self) -> "Frame":
        """Returns the outer frame in this frame."""
        position, orientation = np.empty(3), np.empty(4)
        mujoco.mju_negQuat(orientation, self.orientation)
        mujoco.mju_rotVecQuat(position, -self.position, orientation)
        return Frame(position, orientation)

    def direction(self, vector: FloatArray) -> FloatArray:
        """Returns a vector that is given in this frame, in the outer frame."""
        result = np.empty(3)
        mujoco.mju_rotVecQuat(result, np.asarray(vector, float), self.orientation)
        return result


NO_FRAME = Frame(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
"""The frame that is the outer frame."""


def placed(frame: Frame) -> dict[str, str]:
    """Returns the attributes of MJCF for the place of an element."""
    return {"pos": format_numbers(frame.position), "quat": format_numbers(frame.orientation)}
