"""Base of a robot: its root body, and its pose and velocity in MuJoCo's state.

A base moves freely, or along slide joints and about one hinge, such as the planar walkers of the
dm_control suite; or it is fixed to the world, such as that of an arm.
"""

from collections.abc import Sequence

import mujoco
import numpy as np

from selfmodel.robot.base.fixed_base import FixedBase
from selfmodel.robot.base.free_base import FreeBase
from selfmodel.robot.base.root_body import joints_of_body
from selfmodel.robot.base.sliding_base import ScalarJoint, SlidingBase

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
