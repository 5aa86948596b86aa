"""Floating base with a free joint, such as a walking robot's."""

from collections.abc import Mapping
from dataclasses import dataclass

from selfmodel.arrays import FloatArray
from selfmodel.robot.state.fields import DerivedSignal, StateField
from selfmodel.trials.signals import Signal


@dataclass(frozen=True)
class FreeBase:
    """A floating base with a free joint.

    Attributes:
        position: Index of the first component of the pose in ``qpos``.
        velocity: Index of the first component of the velocity in ``qvel``.
    """

    position: int
    velocity: int

    def signal_fields(self) -> dict[Signal, StateField | DerivedSignal]:
        """Returns the state fields of the signals of the base."""
        return dict(self._fields())

    def write(self, qpos: FloatArray, qvel: FloatArray, base: Mapping[Signal, FloatArray]) -> None:
        """Writes signals of the base into the state; signals that are absent keep their values.

        Args:
            qpos: ``(n, nq)``, written.
            qvel: ``(n, nv)``, written.
            base: Values of the signals to write, ``(n, width)`` each.
        """
        arrays = {"qpos": qpos, "qvel": qvel}
        for signal, field in self._fields().items():
            if signal in base:
                arrays[field.field][:, field.columns] = base[signal]

    def _fields(self) -> dict[Signal, StateField]:
        q, v = self.position, self.velocity
        return {
            "base_position": StateField("qpos", slice(q, q + 3)),
            "base_orientation": StateField("qpos", slice(q + 3, q + 7)),
            "base_linear_velocity": StateField("qvel", slice(v, v + 3)),
            "base_angular_velocity": StateField("qvel", slice(v + 3, v + 6)),
        }
