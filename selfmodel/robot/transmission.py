"""What motors and tendons of a model act on: which hinges they turn, and which bodies they need."""

import mujoco
import numpy as np

_TRN = mujoco.mjtTrn
_JOINT = (int(_TRN.mjTRN_JOINT), int(_TRN.mjTRN_JOINTINPARENT))
_TENDON, _SITE, _BODY = int(_TRN.mjTRN_TENDON), int(_TRN.mjTRN_SITE), int(_TRN.mjTRN_BODY)
TRANSMISSIONS = (*_JOINT, _TENDON, _SITE, _BODY)
"""The transmissions that a robot's motors may have."""

_HINGE = int(mujoco.mjtJoint.mjJNT_HINGE)
_WRAPPED_JOINT = int(mujoco.mjtWrap.mjWRAP_JOINT)
_WRAPPED_SITE = int(mujoco.mjtWrap.mjWRAP_SITE)
_WRAPPED_GEOM = (int(mujoco.mjtWrap.mjWRAP_SPHERE), int(mujoco.mjtWrap.mjWRAP_CYLINDER))


def motor_joints(model: mujoco.MjModel, motor: int) -> frozenset[int]:
    """Returns the numbers of the joints that a motor moves, itself or through a tendon."""
    kind, target = int(model.actuator_trntype[motor]), int(model.actuator_trnid[motor, 0])
    if kind in _JOINT:
        return frozenset({target})
    return tendon_joints(model, target) if kind == _TENDON else frozenset()


def motor_bodies(model: mujoco.MjModel, motor: int) -> frozenset[int]:
    """Returns the numbers of the bodies without any of which a motor moves nothing."""
    kind, target = int(model.actuator_trntype[motor]), int(model.actuator_trnid[motor, 0])
    if kind in _JOINT:
        return frozenset({int(model.jnt_bodyid[target])})
    if kind == _TENDON:
        return tendon_bodies(model, target)
    return frozenset({target if kind == _BODY else int(model.site_bodyid[target])})


def tendon_joints(model: mujoco.MjModel, tendon: int) -> frozenset[int]:
    """Returns the numbers of the joints that change a tendon's length.

    Those of a fixed tendon are in it; those of a spatial one are the hinges that move some of the
    bodies that it runs over, and not all.
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
    """Returns the numbers of the bodies without any of which a tendon pulls at nothing."""
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
    """Returns whether a body is another or hangs on it; a child comes after its parent."""
    while body > ancestor:
        body = int(model.body_parentid[body])
    return body == ancestor


def _wrapped(model: mujoco.MjModel, tendon: int, kinds: tuple[int, ...]) -> list[int]:
    first = int(model.tendon_adr[tendon])
    return [
        int(model.wrap_objid[w])
        for w in range(first, first + int(model.tendon_num[tendon]))
        if int(model.wrap_type[w]) in kinds
    ]
