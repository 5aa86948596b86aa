"""Tendons and equality constraints: what couples joints, and what a fault leaves of it."""

import mujoco
import numpy as np
from numpy.polynomial import Polynomial

from selfmodel.robot.transmission import tendon_bodies, tendon_joints

_EQ_JOINT, _EQ_TENDON = int(mujoco.mjtEq.mjEQ_JOINT), int(mujoco.mjtEq.mjEQ_TENDON)
_SITE = int(mujoco.mjtObj.mjOBJ_SITE)


def cut(model: mujoco.MjModel, body: int) -> None:
    """Slackens the tendons that need a body, and ends the constraints that involve it.

    Args:
        model: Changed; its layout is not.
        body: The number of a body that is lost.
    """
    for tendon in range(model.ntendon):
        if body in tendon_bodies(model, tendon):
            _slacken(model, tendon)
    for constraint in range(model.neq):
        if body in _bodies(model, constraint):
            model.eq_active0[constraint] = 0
    _separate(model, body)


def settle(model: mujoco.MjModel, welded: frozenset[int]) -> None:
    """Ends the limits and constraints of joints that are all held: they would push against a weld.

    Args:
        model: Changed; its layout is not.
        welded: The numbers of all joints that are held still.
    """
    for tendon in range(model.ntendon):
        if tendon_joints(model, tendon) <= welded:
            _slacken(model, tendon)
    for constraint in range(model.neq):
        joints = _joints(model, constraint)
        if joints and joints <= welded:
            model.eq_active0[constraint] = 0


def keep_meaning(model: mujoco.MjModel, joint: int, shift: float) -> None:
    """Has constraints between joints mean the same, though a joint's reference has moved.

    They are told from the references, and by a polynomial of the second joint's angle.

    Args:
        model: Changed.
        joint: The number of the joint.
        shift: How far its reference has moved, rad.
    """
    for constraint in np.flatnonzero(model.eq_type == _EQ_JOINT):
        if model.eq_obj2id[constraint] == joint:
            moved = Polynomial(model.eq_data[constraint, :5])(Polynomial([shift, 1.0]))
            model.eq_data[constraint, :5] = 0.0
            model.eq_data[constraint, : len(moved.coef)] = moved.coef
        if model.eq_obj1id[constraint] == joint:
            model.eq_data[constraint, 0] -= shift


def _slacken(model: mujoco.MjModel, tendon: int) -> None:
    model.tendon_limited[tendon] = 0
    for force in (
        *(model.tendon_stiffness, model.tendon_stiffnesspoly, model.tendon_frictionloss),
        *(model.tendon_damping, model.tendon_dampingpoly, model.tendon_armature),
    ):
        force[tendon] = 0.0


def _separate(model: mujoco.MjModel, body: int) -> None:
    """Has the body touch nothing in pairs of geoms that the model names, whatever their masks."""
    for geoms in (model.pair_geom1, model.pair_geom2):
        pairs = model.geom_bodyid[geoms] == body
        model.pair_margin[pairs] = NEVER


NEVER = -100.0
"""A distance of geoms, m, that no contact is ever below; only below it would there be a force."""


def _joints(model: mujoco.MjModel, constraint: int) -> frozenset[int]:
    """The joints that a constraint between joints or tendons is about."""
    kind = int(model.eq_type[constraint])
    objects = [int(o) for o in (model.eq_obj1id[constraint], model.eq_obj2id[constraint]) if o >= 0]
    if kind == _EQ_JOINT:
        return frozenset(objects)
    if kind == _EQ_TENDON:
        return frozenset[int]().union(*(tendon_joints(model, o) for o in objects))
    return frozenset()


def _bodies(model: mujoco.MjModel, constraint: int) -> frozenset[int]:
    """The bodies that a constraint is about."""
    kind = int(model.eq_type[constraint])
    objects = [int(o) for o in (model.eq_obj1id[constraint], model.eq_obj2id[constraint]) if o >= 0]
    if kind == _EQ_TENDON:
        return frozenset[int]().union(*(tendon_bodies(model, o) for o in objects))
    if kind == _EQ_JOINT:
        return frozenset(int(body) for body in model.jnt_bodyid[objects])
    if int(model.eq_objtype[constraint]) == _SITE:
        return frozenset(int(body) for body in model.site_bodyid[objects])
    return frozenset(objects)
