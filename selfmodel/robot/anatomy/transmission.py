"""Transmissions of motors and tendons: the joints they move and the bodies they act on."""

import mujoco
import numpy as np

_TRN = mujoco.mjtTrn
_JOINT = (int(_TRN.mjTRN_JOINT), int(_TRN.mjTRN_JOINTINPARENT))
_TENDON, _SITE, _BODY = int(_TRN.mjTRN_TENDON), int(_TRN.mjTRN_SITE), int(_TRN.mjTRN_BODY)
SUPPORTED_TRANSMISSIONS = (*_JOINT, _TENDON, _SITE, _BODY)
"""Transmission types that the motors of a robot may have, as ``mjtTrn`` numbers."""

_HINGE = int(mujoco.mjtJoint.mjJNT_HINGE)
_WRAPPED_JOINT = int(mujoco.mjtWrap.mjWRAP_JOINT)
_WRAPPED_SITE = int(mujoco.mjtWrap.mjWRAP_SITE)
_WRAPPED_GEOM = (int(mujoco.mjtWrap.mjWRAP_SPHERE), int(mujoco.mjtWrap.mjWRAP_CYLINDER))


def motor_joints(model: mujoco.MjModel, motor: int) -> frozenset[int]:
    """Returns the ids of the joints that a motor moves, directly or through a tendon."""
    kind, target = int(model.actuator_trntype[motor]), int(model.actuator_trnid[motor, 0])
    if kind in _JOINT:
        return frozenset({target})
    return tendon_joints(model, target) if kind == _TENDON else frozenset()


def length_per_angle(model: mujoco.MjModel, motor: int, hinge: int) -> float:
    """Returns the change of a motor's length per angle of a hinge, in the motor's unit per rad.

    It is constant for motors that act on the hinge, or on a fixed tendon. It is 0 for all others:
    the length of a spatial tendon is no function of the measured angle of a single hinge.

    Args:
        model: A compiled model.
        motor: Id of the motor.
        hinge: Id of the hinge.
    """
    kind, target = int(model.actuator_trntype[motor]), int(model.actuator_trnid[motor, 0])
    gear = float(model.actuator_gear[motor, 0])
    if kind in _JOINT:
        return gear if target == hinge else 0.0
    if kind != _TENDON:
        return 0.0
    path = slice(first := int(model.tendon_adr[target]), first + int(model.tendon_num[target]))
    own = (model.wrap_type[path] == _WRAPPED_JOINT) & (model.wrap_objid[path] == hinge)
    return gear * float(model.wrap_prm[path][own].sum())


def has_feedback(model: mujoco.MjModel, motor: int) -> bool:
    """Returns whether the force of a motor depends on its position, as that of a servo does."""
    is_affine = model.actuator_biastype[motor] == mujoco.mjtBias.mjBIAS_AFFINE
    return bool(is_affine and model.actuator_biasprm[motor, 1] != 0)


def motor_bodies(model: mujoco.MjModel, motor: int) -> frozenset[int]:
    """Returns the ids of the bodies that a motor requires to have an effect."""
    kind, target = int(model.actuator_trntype[motor]), int(model.actuator_trnid[motor, 0])
    if kind in _JOINT:
        return frozenset({int(model.jnt_bodyid[target])})
    if kind == _TENDON:
        return tendon_bodies(model, target)
    return frozenset({target if kind == _BODY else int(model.site_bodyid[target])})


def tendon_joints(model: mujoco.MjModel, tendon: int) -> frozenset[int]:
    """Returns the ids of the joints that change the length of a tendon.

    The model lists the joints of a fixed tendon. For a spatial tendon, the result has each hinge
    that moves some, but not all, of the bodies on the path of the tendon.
    """
    joints = _wrapped(model, tendon, (_WRAPPED_JOINT,))
    if joints:
        return frozenset(joints)
    bodies = tendon_bodies(model, tendon)
    return frozenset(
        j
        for j in range(model.njnt)
        if model.jnt_type[j] == _HINGE
        and 0 < sum(descends(model, b, int(model.jnt_bodyid[j])) for b in bodies) < len(bodies)
    )


def tendon_bodies(model: mujoco.MjModel, tendon: int) -> frozenset[int]:
    """Returns the ids of the bodies on the path of a tendon, all required for its effect."""
    joints = _wrapped(model, tendon, (_WRAPPED_JOINT,))
    sites = _wrapped(model, tendon, (_WRAPPED_SITE,))
    geoms = _wrapped(model, tendon, _WRAPPED_GEOM)
    return frozenset(
        int(body)
        for body in np.concatenate(
            [model.jnt_bodyid[joints], model.site_bodyid[sites], model.geom_bodyid[geoms]]
        )
    )


def descends(model: mujoco.MjModel, body: int, ancestor: int) -> bool:
    """Returns whether a body is the ancestor itself or a descendant of the ancestor."""
    while body > ancestor:  # the id of a child is larger than that of its parent
        body = int(model.body_parentid[body])
    return body == ancestor


def _wrapped(model: mujoco.MjModel, tendon: int, kinds: tuple[int, ...]) -> list[int]:
    """Returns the ids of the objects of some ``mjtWrap`` types on the path of a tendon."""
    first = int(model.tendon_adr[tendon])
    return [
        int(model.wrap_objid[w])
        for w in range(first, first + int(model.tendon_num[tendon]))
        if int(model.wrap_type[w]) in kinds
    ]
