"""The root of a robot: which body it is, and where its pose and velocity stand in MuJoCo's state.

A root floats freely, or in a part of the directions: one that slides along fixed axes and then
turns about one hinge at most, such as the planar walkers of the dm_control suite.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.trials.behaviour import Signal
from selfmodel.trials.rotation import product, rotated

Bind = Callable[[str], FloatArray]
"""Gives the array that holds a field of MuJoCo's state of many robots, ``(n, width)``."""

Reader = Callable[[], FloatArray]
"""Gives the present value of a signal, ``(n, width)``; it may be a view of the state."""


@dataclass(frozen=True)
class StateField:
    """A field of MjData, and the columns of it that hold a signal."""

    field: str
    columns: slice | list[int]

    def reader(self, bind: Bind) -> Reader:
        """Returns what reads the signal."""
        values, chosen = bind(self.field), self.columns
        return lambda: values[:, chosen]


@dataclass(frozen=True)
class DerivedSignal:
    """A signal that follows from positions and velocities."""

    compute: Callable[[FloatArray, FloatArray], FloatArray]

    def reader(self, bind: Bind) -> Reader:
        """Returns what computes the signal."""
        qpos, qvel = bind("qpos"), bind("qvel")
        return lambda: self.compute(qpos, qvel)


@dataclass(frozen=True)
class FreeRoot:
    """A body with a free joint.

    Attributes:
        position: Where its pose begins in ``qpos``.
        velocity: Where its velocity begins in ``qvel``.
    """

    position: int
    velocity: int

    def signal_fields(self) -> dict[Signal, StateField | DerivedSignal]:
        """Returns where the signals of the base stand."""
        return dict(self._columns())

    def write(self, qpos: FloatArray, qvel: FloatArray, base: Mapping[Signal, FloatArray]) -> None:
        """Puts signals of the base into the state; what is not given stays.

        Args:
            qpos: ``(n, nq)``, written.
            qvel: ``(n, nv)``, written.
            base: ``(n, width)`` for each signal that is to be written.
        """
        fields = {"qpos": qpos, "qvel": qvel}
        for signal, place in self._columns().items():
            if signal in base:
                fields[place.field][:, place.columns] = base[signal]

    def _columns(self) -> dict[Signal, StateField]:
        q, v = self.position, self.velocity
        return {
            "base_position": StateField("qpos", slice(q, q + 3)),
            "base_orientation": StateField("qpos", slice(q + 3, q + 7)),
            "base_linear_velocity": StateField("qvel", slice(v, v + 3)),
            "base_angular_velocity": StateField("qvel", slice(v + 3, v + 6)),
        }


@dataclass(frozen=True)
class Degree:
    """A slide or a hinge of a root.

    Attributes:
        position: Its place in ``qpos``.
        velocity: Its place in ``qvel``.
        reference: The value at which the body stands as the model says.
    """

    position: int
    velocity: int
    reference: float


@dataclass(frozen=True, eq=False)
class SlidingRoot:
    """A body with slides, and after them a hinge or none, between itself and the world.

    Attributes:
        position: Of the body in the reference configuration, ``(1, 3)`` m, or ``(n, 3)`` where it
            stands differently in each of many models, as on slopes.
        orientation: Of the body there, ``(1, 4)`` or ``(n, 4)``, w x y z.
        slides: At least one.
        axes: Of the slides, ``(slides, 3)`` in the body's frame there.
        hinge: The hinge, or None.
        axis: Of the hinge, ``(3,)`` in the body's frame.
        anchor: The point about which it turns, ``(3,)`` in the body's frame.
    """

    position: FloatArray
    orientation: FloatArray
    slides: tuple[Degree, ...]
    axes: FloatArray
    hinge: Degree | None
    axis: FloatArray
    anchor: FloatArray

    def signal_fields(self) -> dict[Signal, StateField | DerivedSignal]:
        """Returns how the signals of the base follow from the state."""
        return {
            "base_position": DerivedSignal(self._position),
            "base_orientation": DerivedSignal(self._orientation),
            "base_linear_velocity": DerivedSignal(self._linear_velocity),
            "base_angular_velocity": DerivedSignal(self._angular_velocity),
        }

    def write(self, qpos: FloatArray, qvel: FloatArray, base: Mapping[Signal, FloatArray]) -> None:
        """Puts signals of the base into the state, as far as it can move; what is not given stays.

        See ``FreeRoot.write``. A rotation about another axis than the hinge's is left out, and so
        is a way that the slides cannot go.
        """
        # A hinge beside the origin moves it: where the base is must be known before it turns.
        position = base.get("base_position", self._position(qpos, qvel))
        velocity = base.get("base_linear_velocity", self._linear_velocity(qpos, qvel))
        if self.hinge is not None and "base_orientation" in base:
            angle = self._angle_of(base["base_orientation"])
            qpos[:, self.hinge.position] = self.hinge.reference + angle
        if self.hinge is not None and "base_angular_velocity" in base:
            turning = (base["base_angular_velocity"] * self.axis).sum(axis=1)
            qvel[:, self.hinge.velocity] = turning
        lever, swing = self._lever(qpos, qvel)
        back = self.orientation * (1.0, -1.0, -1.0, -1.0)
        way = rotated(position - self.position, back) - lever
        speed = rotated(velocity, back) - swing
        for slide, along in zip(self.slides, np.linalg.pinv(self.axes).T, strict=True):
            qpos[:, slide.position] = slide.reference + (way * along).sum(axis=1)
            qvel[:, slide.velocity] = (speed * along).sum(axis=1)

    def _position(self, qpos: FloatArray, qvel: FloatArray) -> FloatArray:
        way = self._lever(qpos, qvel)[0]
        for slide, axis in zip(self.slides, self.axes, strict=True):
            way = way + (qpos[:, slide.position, np.newaxis] - slide.reference) * axis
        return np.asarray(self.position + rotated(way, self.orientation))

    def _linear_velocity(self, qpos: FloatArray, qvel: FloatArray) -> FloatArray:
        velocity = self._lever(qpos, qvel)[1]
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
        """How far the body is turned, ``(n,)`` rad."""
        if self.hinge is None:
            return np.zeros(len(qpos))
        return np.asarray(qpos[:, self.hinge.position] - self.hinge.reference)

    def _angle_of(self, orientation: FloatArray) -> FloatArray:
        """How far a body of that orientation is turned about the axis, ``(n,)`` rad."""
        turn = product(self.orientation * (1.0, -1.0, -1.0, -1.0), orientation)
        half = np.arctan2((turn[:, 1:] * self.axis).sum(axis=1), turn[:, 0])
        # A quaternion and its negative are one rotation.
        return np.asarray(np.remainder(2 * half + np.pi, 2 * np.pi) - np.pi)

    def _lever(self, qpos: FloatArray, qvel: FloatArray) -> tuple[FloatArray, FloatArray]:
        """How far, and how fast, turning has moved the body's origin, ``(n, 3)`` each.

        In the frame in which the axes of the slides are told.
        """
        angle = self._angle(qpos)[:, np.newaxis]
        if self.hinge is None or not self.anchor.any():
            return np.zeros((len(angle), 3)), np.zeros((len(angle), 3))
        outward = self.anchor - self.axis * (self.axis @ self.anchor)
        across = np.cross(self.axis, self.anchor)
        cosine, sine = np.cos(angle), np.sin(angle)
        speed = qvel[:, self.hinge.velocity, np.newaxis]
        return (
            outward * (1 - cosine) - across * sine,
            speed * (outward * sine - across * cosine),
        )


Root = FreeRoot | SlidingRoot


def root_of(models: Sequence[mujoco.MjModel], name: str) -> Root:
    """Returns the root that is the body of that name; see ``find_root``.

    Args:
        models: One for all rows of a state, or one for each; they share one layout.
        name: The body's.
    """
    model = models[0]
    body = model.body(name)
    joints = joints_of(model, int(body.id))
    if model.jnt_type[joints[0]] == _FREE:
        return FreeRoot(int(model.jnt_qposadr[joints[0]]), int(model.jnt_dofadr[joints[0]]))
    slides = [j for j in joints if model.jnt_type[j] == _SLIDE]
    hinge = joints[-1] if model.jnt_type[joints[-1]] == _HINGE else None
    return SlidingRoot(
        position=np.array([each.body_pos[body.id] for each in models]),
        orientation=np.array([each.body_quat[body.id] for each in models]),
        slides=tuple(_degree(model, slide) for slide in slides),
        axes=model.jnt_axis[slides],
        hinge=None if hinge is None else _degree(model, hinge),
        axis=np.array([0.0, 0.0, 1.0]) if hinge is None else model.jnt_axis[hinge].copy(),
        anchor=np.zeros(3) if hinge is None else model.jnt_pos[hinge].copy(),
    )


def joints_of(model: mujoco.MjModel, body: int) -> list[int]:
    """Returns the numbers of the joints between a body and its parent."""
    first = int(model.body_jntadr[body])
    return list(range(first, first + int(model.body_jntnum[body])))


def find_root(model: mujoco.MjModel, driven: frozenset[int]) -> int:
    """Returns the number of the root body of a robot.

    Args:
        model: A compiled MJCF.
        driven: The numbers of the joints that motors move.

    Raises:
        ValueError: There is none, or there are several.
    """
    floating = [int(model.jnt_bodyid[j]) for j in np.flatnonzero(model.jnt_type == _FREE)]
    if not floating:
        floating = [
            body
            for body in np.flatnonzero(model.body_parentid == 0).tolist()
            if body and _is_sliding(model, body, driven)
        ]
    if len(floating) > 1:
        names = ", ".join(model.body(body).name or f"number {body}" for body in floating)
        raise ValueError(f"the model needs one root body that moves freely, and has {names}")
    if not floating:
        raise ValueError(
            "the model needs a root body with a free joint, or with slides and after them at most "
            "one hinge that no motor moves, and has none: its base is fixed"
        )
    return floating[0]


_FREE, _SLIDE, _HINGE = (
    int(mujoco.mjtJoint.mjJNT_FREE),
    int(mujoco.mjtJoint.mjJNT_SLIDE),
    int(mujoco.mjtJoint.mjJNT_HINGE),
)


def _is_sliding(model: mujoco.MjModel, body: int, driven: frozenset[int]) -> bool:
    joints = joints_of(model, body)
    kinds = [int(model.jnt_type[j]) for j in joints]
    slides = kinds.count(_SLIDE)
    if not slides or kinds not in ([_SLIDE] * slides, [_SLIDE] * slides + [_HINGE]):
        return False
    independent = np.linalg.matrix_rank(model.jnt_axis[joints[:slides]]) == slides
    return bool(independent) and not driven.intersection(joints)


def _degree(model: mujoco.MjModel, joint: int) -> Degree:
    position = int(model.jnt_qposadr[joint])
    return Degree(position, int(model.jnt_dofadr[joint]), float(model.qpos0[position]))
