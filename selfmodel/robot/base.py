"""Base of a robot: its root body, and its pose and velocity in MuJoCo's state.

A base moves freely, or along slide joints and about one hinge, such as the planar walkers of the
dm_control suite; or it is fixed to the world, such as that of an arm.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.robot.fixed_base import FixedBase
from selfmodel.robot.sliding_base import ScalarJoint, SlidingBase
from selfmodel.robot.state_fields import DerivedSignal, StateField
from selfmodel.trials.signals import Signal

_FREE, _SLIDE, _HINGE = (
    int(mujoco.mjtJoint.mjJNT_FREE),
    int(mujoco.mjtJoint.mjJNT_SLIDE),
    int(mujoco.mjtJoint.mjJNT_HINGE),
)


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


def joints_of_body(model: mujoco.MjModel, body: int) -> list[int]:
    """Returns the ids of the joints between a body and its parent."""
    first = int(model.body_jntadr[body])
    return list(range(first, first + int(model.body_jntnum[body])))


def find_root_body(model: mujoco.MjModel, driven: frozenset[int]) -> int:
    """Returns the id of the root body of a robot.

    The root body is the body with a free joint or with slide joints. Without such a body the base
    is fixed, and the root body is the static body that carries all driven joints: of several, the
    one nearest to the joints.

    Args:
        model: A compiled MJCF.
        driven: Ids of the joints that motors move.

    Raises:
        ValueError: The model has several floating bases; or none, and slide joints on a body of the
            world, or no static body below the world that carries all driven joints.
    """
    floating = floating_bodies(model, driven)
    if len(floating) > 1:
        names = ", ".join(model.body(body).name or f"number {body}" for body in floating)
        raise ValueError(
            f"expected one root body that moves freely, got {names}: keep the robot, and remove "
            f"the other bodies or fix them to the world"
        )
    if floating:
        return floating[0]
    if not driven:
        raise ValueError("the motors drive no joint: give the joints of the limbs motors")
    _check_hinged(model)
    carrier = common_carrier(model, driven)
    if not carrier:
        raise ValueError(
            "the driven joints are on several bodies of the world, or directly on one, and the "
            "base is fixed: put them into one <body>, which is the root body"
        )
    return carrier


def floating_bodies(model: mujoco.MjModel, driven: frozenset[int]) -> list[int]:
    """Returns the ids of the bodies that can be a floating base.

    Args:
        model: A compiled MJCF.
        driven: Ids of the joints that motors move.
    """
    free = [int(model.jnt_bodyid[j]) for j in np.flatnonzero(model.jnt_type == _FREE)]
    return free or [
        body
        for body in np.flatnonzero(model.body_parentid == 0).tolist()
        if body and _is_sliding_base(model, body, driven)
    ]


def common_carrier(model: mujoco.MjModel, joints: frozenset[int]) -> int:
    """Returns the id of the static body nearest to some joints that carries all of them.

    Args:
        model: A compiled MJCF.
        joints: Ids of at least one joint.

    Returns:
        The id of the body; 0, the world, if no other static body carries all the joints.
    """
    chains = [_static_chain(model, int(model.jnt_bodyid[joint])) for joint in joints]
    return max(set(chains[0]).intersection(*chains[1:]))


def _static_chain(model: mujoco.MjModel, body: int) -> list[int]:
    """Returns the ids of the static bodies that carry a body, with the world."""
    chain = []
    while body:
        body = int(model.body_parentid[body])
        if not model.body_weldid[body]:
            chain.append(body)
    return chain


def _check_hinged(model: mujoco.MjModel) -> None:
    """Refuses bodies of a world that have a slide or ball joint and are no floating base."""
    for joint in range(model.njnt):
        parent = int(model.body_parentid[model.jnt_bodyid[joint]])
        if model.jnt_type[joint] != _HINGE and not model.body_weldid[parent]:
            raise ValueError(
                f"the model needs a root body with a free joint, with slide joints and then at "
                f"most one hinge that no motor moves, or without a joint (its base is fixed), and "
                f"the body {model.body(model.jnt_bodyid[joint]).name or 'without a name'} has "
                f"other joints: give the root body a <freejoint/>, or only hinges to its parent"
            )


def _is_sliding_base(model: mujoco.MjModel, body: int, driven: frozenset[int]) -> bool:
    joints = joints_of_body(model, body)
    kinds = [int(model.jnt_type[j]) for j in joints]
    slides = kinds.count(_SLIDE)
    if not slides or kinds not in ([_SLIDE] * slides, [_SLIDE] * slides + [_HINGE]):
        return False
    independent = np.linalg.matrix_rank(model.jnt_axis[joints[:slides]]) == slides
    return bool(independent) and not driven.intersection(joints)


def _scalar_joint(model: mujoco.MjModel, joint: int) -> ScalarJoint:
    position = int(model.jnt_qposadr[joint])
    return ScalarJoint(position, int(model.jnt_dofadr[joint]), float(model.qpos0[position]))
