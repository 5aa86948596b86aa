"""Floating base with slide joints and at most one hinge, such as a planar walker of dm_control."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.robot.state.fields import DerivedSignal, StateField
from selfmodel.trials.rotation import product, rotated
from selfmodel.trials.signals import Signal


@dataclass(frozen=True)
class ScalarJoint:
    """A slide or hinge joint of a floating base.

    Attributes:
        position: Index in ``qpos``.
        velocity: Index in ``qvel``.
        reference: Joint position in the reference configuration, m or rad.
    """

    position: int
    velocity: int
    reference: float


@dataclass(frozen=True, eq=False)
class SlidingBase:
    """A floating base with slide joints, then at most one hinge, between the world and the body.

    Attributes:
        position: Position of the body in the reference configuration, ``(1, 3)`` m; ``(n, 3)`` if
            it differs between n models, as on slopes.
        orientation: Orientation of the body in the reference configuration, ``(1, 4)`` or
            ``(n, 4)``, w x y z.
        slides: Slide joints, at least one.
        axes: Axes of the slide joints in the body's reference frame, ``(slides, 3)``.
        hinge: The hinge, or None.
        axis: Axis of the hinge in the body frame, ``(3,)``.
        anchor: Position of the hinge in the body frame, ``(3,)`` m.
    """

    position: FloatArray
    orientation: FloatArray
    slides: tuple[ScalarJoint, ...]
    axes: FloatArray
    hinge: ScalarJoint | None
    axis: FloatArray
    anchor: FloatArray

    def signal_fields(self) -> dict[Signal, StateField | DerivedSignal]:
        """Returns the signals of the base as functions of the state."""
        return {
            "base_position": DerivedSignal(self._position),
            "base_orientation": DerivedSignal(self._orientation),
            "base_linear_velocity": DerivedSignal(self._linear_velocity),
            "base_angular_velocity": DerivedSignal(self._angular_velocity),
        }

    def write(self, qpos: FloatArray, qvel: FloatArray, base: Mapping[Signal, FloatArray]) -> None:
        """Writes signals of the base into the state; signals that are absent keep their values.

        The part of a signal outside the degrees of freedom is dropped: a rotation about another
        axis than the hinge's, and a translation across the slide axes.

        Args:
            qpos: ``(n, nq)``, written.
            qvel: ``(n, nv)``, written.
            base: Values of the signals to write, ``(n, width)`` each.
        """
        # A hinge beside the origin moves the origin: read the position before the hinge turns.
        position = base.get("base_position", self._position(qpos, qvel))
        velocity = base.get("base_linear_velocity", self._linear_velocity(qpos, qvel))
        if self.hinge is not None and "base_orientation" in base:
            angle = self._angle_of(base["base_orientation"])
            qpos[:, self.hinge.position] = self.hinge.reference + angle
        if self.hinge is not None and "base_angular_velocity" in base:
            rate = (base["base_angular_velocity"] * self.axis).sum(axis=1)
            qvel[:, self.hinge.velocity] = rate
        shift, shift_rate = self._origin_shift(qpos, qvel)
        inverse = self.orientation * (1.0, -1.0, -1.0, -1.0)
        translation = rotated(position - self.position, inverse) - shift
        speed = rotated(velocity, inverse) - shift_rate
        for slide, along in zip(self.slides, np.linalg.pinv(self.axes).T, strict=True):
            qpos[:, slide.position] = slide.reference + (translation * along).sum(axis=1)
            qvel[:, slide.velocity] = (speed * along).sum(axis=1)

    def _position(self, qpos: FloatArray, qvel: FloatArray) -> FloatArray:
        translation = self._origin_shift(qpos, qvel)[0]
        for slide, axis in zip(self.slides, self.axes, strict=True):
            travel = qpos[:, slide.position, np.newaxis] - slide.reference
            translation = translation + travel * axis
        return np.asarray(self.position + rotated(translation, self.orientation))

    def _linear_velocity(self, qpos: FloatArray, qvel: FloatArray) -> FloatArray:
        velocity = self._origin_shift(qpos, qvel)[1]
        for slide, axis in zip(self.slides, self.axes, strict=True):
            velocity = velocity + qvel[:, slide.velocity, np.newaxis] * axis
        return rotated(velocity, self.orientation)

    def _orientation(self, qpos: FloatArray, _qvel: FloatArray) -> FloatArray:
        half = self._angle(qpos)[:, np.newaxis] / 2
        return product(self.orientation, np.hstack([np.cos(half), np.sin(half) * self.axis]))

    def _angular_velocity(self, _qpos: FloatArray, qvel: FloatArray) -> FloatArray:
        if self.hinge is None:
            return np.zeros((len(qvel), 3))
        return np.asarray(qvel[:, self.hinge.velocity, np.newaxis] * self.axis)

    def _angle(self, qpos: FloatArray) -> FloatArray:
        """Returns the angle of the hinge from its reference, ``(n,)`` rad."""
        if self.hinge is None:
            return np.zeros(len(qpos))
        return np.asarray(qpos[:, self.hinge.position] - self.hinge.reference)

    def _angle_of(self, orientation: FloatArray) -> FloatArray:
        """Returns the rotation about the hinge axis for orientations of the body, ``(n,)`` rad."""
        rotation = product(self.orientation * (1.0, -1.0, -1.0, -1.0), orientation)
        half = np.arctan2((rotation[:, 1:] * self.axis).sum(axis=1), rotation[:, 0])
        # A quaternion and its negative are the same rotation.
        return np.asarray(np.remainder(2 * half + np.pi, 2 * np.pi) - np.pi)

    def _origin_shift(self, qpos: FloatArray, qvel: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Returns displacement and velocity of the body's origin due to the hinge.

        Both are ``(n, 3)``, m and m/s, in the body's reference frame.
        """
        angle = self._angle(qpos)[:, np.newaxis]
        if self.hinge is None or not self.anchor.any():
            return np.zeros((len(angle), 3)), np.zeros((len(angle), 3))
        outward = self.anchor - self.axis * (self.axis @ self.anchor)
        across = np.cross(self.axis, self.anchor)
        cosine, sine = np.cos(angle), np.sin(angle)
        rate = qvel[:, self.hinge.velocity, np.newaxis]
        return (
            outward * (1 - cosine) - across * sine,
            rate * (outward * sine - across * cosine),
        )
