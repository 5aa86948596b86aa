"""Base of a robot: its root body, and its pose and velocity in MuJoCo's state.

A base moves freely, or along slide joints and about one hinge, such as the planar walkers of the
dm_control suite; or it is fixed to the world, such as that of an arm.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.robot.anatomy_reader import joints_of_body
from selfmodel.trials.rotation import product, rotated
from selfmodel.trials.signals import Signal

Bind = Callable[[str], FloatArray]
"""Returns the array of a field of MuJoCo's state of many robots, ``(n, width)``, by name."""

Reader = Callable[[], FloatArray]
"""Returns the current value of a signal, ``(n, width)``; the value may be a view of the state."""


@dataclass(frozen=True)
class StateField:
    """A signal that MuJoCo's state contains: columns of a field of MjData.

    Attributes:
        field: Name of the field, such as ``qpos``.
        columns: Columns of the field.
    """

    field: str
    columns: slice | list[int]

    def reader(self, bind: Bind) -> Reader:
        """Returns a function that reads the signal from the bound state."""
        values, chosen = bind(self.field), self.columns
        return lambda: values[:, chosen]


@dataclass(frozen=True, eq=False)
class ShiftedField:
    """A signal that differs from a field of MuJoCo's state by constants.

    Attributes:
        field: The field.
        shift: Signal minus field, ``(n, width)``.
    """

    field: StateField
    shift: FloatArray

    def reader(self, bind: Bind) -> Reader:
        """Returns a function that reads the signal from the bound state."""
        true = self.field.reader(bind)
        return lambda: true() + self.shift


@dataclass(frozen=True)
class DerivedSignal:
    """A signal that is computed from positions and velocities.

    Attributes:
        compute: Function from ``qpos``, ``(n, nq)``, and ``qvel``, ``(n, nv)``, to the signal,
            ``(n, width)``.
    """

    compute: Callable[[FloatArray, FloatArray], FloatArray]

    def reader(self, bind: Bind) -> Reader:
        """Returns a function that computes the signal from the bound state."""
        qpos, qvel = bind("qpos"), bind("qvel")
        return lambda: self.compute(qpos, qvel)


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


_FREE, _SLIDE, _HINGE = (
    int(mujoco.mjtJoint.mjJNT_FREE),
    int(mujoco.mjtJoint.mjJNT_SLIDE),
    int(mujoco.mjtJoint.mjJNT_HINGE),
)

Base = FreeBase | SlidingBase | FixedBase


def read_base(models: Sequence[mujoco.MjModel], root: str) -> Base:
    """Returns the base of a robot.

    Args:
        models: One model for all rows of a state, or one model per row; they share one layout.
        root: Name of the root body; see ``find_root_body``.
    """
    model = models[0]
    body = model.body(root)
    joints = joints_of_body(model, int(body.id))
    if not joints:
        return FixedBase.of(models, int(body.id))
    if model.jnt_type[joints[0]] == _FREE:
        return FreeBase(int(model.jnt_qposadr[joints[0]]), int(model.jnt_dofadr[joints[0]]))
    slides = [j for j in joints if model.jnt_type[j] == _SLIDE]
    hinge = joints[-1] if model.jnt_type[joints[-1]] == _HINGE else None
    return SlidingBase(
        position=np.array([each.body_pos[body.id] for each in models]),
        orientation=np.array([each.body_quat[body.id] for each in models]),
        slides=tuple(_scalar_joint(model, slide) for slide in slides),
        axes=model.jnt_axis[slides],
        hinge=None if hinge is None else _scalar_joint(model, hinge),
        axis=np.array([0.0, 0.0, 1.0]) if hinge is None else model.jnt_axis[hinge].copy(),
        anchor=np.zeros(3) if hinge is None else model.jnt_pos[hinge].copy(),
    )


def _scalar_joint(model: mujoco.MjModel, joint: int) -> ScalarJoint:
    position = int(model.jnt_qposadr[joint])
    return ScalarJoint(position, int(model.jnt_dofadr[joint]), float(model.qpos0[position]))
