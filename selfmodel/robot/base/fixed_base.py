"""Fixed base: a root body that is welded to the world, such as an arm's or a stand's."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.robot.state.fields import DerivedSignal, StateField
from selfmodel.trials.rotation import product, rotated
from selfmodel.trials.signals import Signal


@dataclass(frozen=True, eq=False)
class FixedBase:
    """A base without degrees of freedom: its pose is a constant of the model.

    Attributes:
        position: Position of the root body in the world, ``(1, 3)`` m; ``(n, 3)`` if it differs
            between n models, as on slopes.
        orientation: Orientation of the root body in the world, ``(1, 4)`` or ``(n, 4)``, w x y z.
    """

    position: FloatArray
    orientation: FloatArray

    @classmethod
    def of(cls, models: Sequence[mujoco.MjModel], body: int) -> "FixedBase":
        """Returns the fixed base of models that share one layout.

        Args:
            models: One model for all rows of a state, or one model per row.
            body: Id of the root body.
        """
        # One model serves many rows of a batch of segments.
        poses = {key: reference_pose(one, body) for key, one in {id(m): m for m in models}.items()}
        rows = [poses[id(model)] for model in models]
        return cls(np.array([row[0] for row in rows]), np.array([row[1] for row in rows]))

    def signal_fields(self) -> dict[Signal, StateField | DerivedSignal]:
        """Returns the signals of the base: a constant pose, and velocities of zero."""
        return {
            "base_position": _constant(self.position),
            "base_orientation": _constant(self.orientation),
            "base_linear_velocity": _constant(np.zeros((1, 3))),
            "base_angular_velocity": _constant(np.zeros((1, 3))),
        }

    def write(self, qpos: FloatArray, qvel: FloatArray, base: Mapping[Signal, FloatArray]) -> None:
        """Leaves the state unchanged: signals of a fixed base are not part of it."""


def _constant(rows: FloatArray) -> DerivedSignal:
    return DerivedSignal(lambda qpos, _qvel: np.broadcast_to(rows, (len(qpos), rows.shape[1])))


def reference_pose(model: mujoco.MjModel, body: int) -> tuple[FloatArray, FloatArray]:
    """Returns position and orientation of a body of static bodies in the reference configuration.

    Args:
        model: A compiled MJCF.
        body: Id of a body whose ancestors are static.

    Returns:
        Position, ``(3,)`` m, and orientation, ``(4,)``, w x y z, in the world.
    """
    position, orientation = model.body_pos[body].copy(), model.body_quat[body].copy()
    parent = int(model.body_parentid[body])
    while parent:
        turn = model.body_quat[parent]
        position = model.body_pos[parent] + rotated(position, turn)
        orientation = product(turn, orientation)
        parent = int(model.body_parentid[parent])
    return position, orientation
