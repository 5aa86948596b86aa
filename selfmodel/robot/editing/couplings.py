"""Edits of couplings: tendons, equality constraints and contact pairs of a faulty robot."""

import mujoco
import numpy as np
from numpy.polynomial import Polynomial

from selfmodel.robot.anatomy.transmission import tendon_bodies, tendon_joints

_EQ_JOINT, _EQ_TENDON = int(mujoco.mjtEq.mjEQ_JOINT), int(mujoco.mjtEq.mjEQ_TENDON)
_SITE = int(mujoco.mjtObj.mjOBJ_SITE)

NO_CONTACT_MARGIN = -100.0
"""Contact margin that disables a contact pair, m: a contact has a force only while the distance of
its geoms is below the margin."""


def release(model: mujoco.MjModel, body: int) -> None:
    """Removes the forces of tendons, equality constraints and contact pairs of a detached body.

    Args:
        model: The model, edited in place; its layout stays.
        body: Id of the detached body.
    """
    for tendon in range(model.ntendon):
        if body in tendon_bodies(model, tendon):
            _slacken(model, tendon)
    for constraint in range(model.neq):
        if body in _constrained_bodies(model, constraint):
            model.eq_active0[constraint] = 0
    _disable_pairs(model, body)


def disable_welded(model: mujoco.MjModel, welded: frozenset[int]) -> None:
    """Disables tendons and equality constraints that couple welded joints only.

    Their forces would act against the weld.

    Args:
        model: The model, edited in place; its layout stays.
        welded: Ids of all welded joints.
    """
    for tendon in range(model.ntendon):
        if tendon_joints(model, tendon) <= welded:
            _slacken(model, tendon)
    for constraint in range(model.neq):
        joints = _constrained_joints(model, constraint)
        if joints and joints <= welded:
            model.eq_active0[constraint] = 0


def rebase_equality(model: mujoco.MjModel, joint: int, shift: float) -> None:
    """Rewrites joint equality constraints for a new reference angle; their effect is unchanged.

    A joint equality constraint relates the angles from the references of both joints, by a
    polynomial of the second joint's angle.

    Args:
        model: The model, edited in place.
        joint: Id of the joint whose reference has changed.
        shift: New minus old reference angle, rad.
    """
    for constraint in np.flatnonzero(model.eq_type == _EQ_JOINT):
        if model.eq_obj2id[constraint] == joint:
            shifted = Polynomial(model.eq_data[constraint, :5])(Polynomial([shift, 1.0]))
            model.eq_data[constraint, :5] = 0.0
            model.eq_data[constraint, : len(shifted.coef)] = shifted.coef
        if model.eq_obj1id[constraint] == joint:
            model.eq_data[constraint, 0] -= shift


def _slacken(model: mujoco.MjModel, tendon: int) -> None:
    """Removes the limits and the passive forces of a tendon."""
    model.tendon_limited[tendon] = 0
    for force in (
        *(model.tendon_stiffness, model.tendon_stiffnesspoly, model.tendon_frictionloss),
        *(model.tendon_damping, model.tendon_dampingpoly, model.tendon_armature),
    ):
        force[tendon] = 0.0


def _disable_pairs(model: mujoco.MjModel, body: int) -> None:
    """Disables the explicit contact pairs of a body, which contype does not affect."""
    for geoms in (model.pair_geom1, model.pair_geom2):
        pairs = model.geom_bodyid[geoms] == body
        model.pair_margin[pairs] = NO_CONTACT_MARGIN


def _constrained_joints(model: mujoco.MjModel, constraint: int) -> frozenset[int]:
    """Returns the ids of the joints of a joint or tendon equality constraint, or none."""
    kind = int(model.eq_type[constraint])
    objects = [int(o) for o in (model.eq_obj1id[constraint], model.eq_obj2id[constraint]) if o >= 0]
    if kind == _EQ_JOINT:
        return frozenset(objects)
    if kind == _EQ_TENDON:
        return frozenset[int]().union(*(tendon_joints(model, o) for o in objects))
    return frozenset()


def _constrained_bodies(model: mujoco.MjModel, constraint: int) -> frozenset[int]:
    """Returns the ids of the bodies that an equality constraint involves."""
    kind = int(model.eq_type[constraint])
    objects = [int(o) for o in (model.eq_obj1id[constraint], model.eq_obj2id[constraint]) if o >= 0]
    if kind == _EQ_TENDON:
        return frozenset[int]().union(*(tendon_bodies(model, o) for o in objects))
    if kind == _EQ_JOINT:
        return frozenset(int(body) for body in model.jnt_bodyid[objects])
    if int(model.eq_objtype[constraint]) == _SITE:
        return frozenset(int(body) for body in model.site_bodyid[objects])
    return frozenset(objects)
