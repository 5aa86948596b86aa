"""Edits of a compiled model, in place, for the faults of its parts; the layout stays.

``selfmodel.trials.rotation`` rotates whole trajectories; its results differ in the last bits from
those of MuJoCo's functions, which are used here.
"""

import mujoco
import numpy as np
from numpy.polynomial import Polynomial

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.robot.actuators import (
    has_feedback,
    length_per_angle,
    motor_joints,
    tendon_bodies,
    tendon_joints,
)
from selfmodel.robot.contacts import can_touch, static_geoms

_MIN_MIX = 1e-15
"""Smallest weight of a geom in the mean of contact parameters (MuJoCo's ``mjMINVAL``)."""


def scale_grip(model: mujoco.MjModel, bodies: IndexArray, factor: float) -> None:
    """Scales the sliding friction of all contacts of some bodies.

    A contact has the larger friction of its two geoms, so that less friction of one geom alone has
    no effect. The geoms of the bodies get a higher priority than all other geoms: a contact then
    has the parameters of the geom with the higher priority. The parameters that they had in a
    contact with the ground are written into these geoms.

    Args:
        model: The model, edited in place; its layout stays.
        bodies: Ids of the bodies.
        factor: Factor of the sliding friction.
    """
    priority = int(model.geom_priority.max()) + 1
    geoms = np.flatnonzero(np.isin(model.geom_bodyid, bodies))
    for geom in geoms:
        ground = _ground_of(model, int(geom))
        if ground is not None:
            _adopt_contact_parameters(model, int(geom), ground)
    model.geom_friction[geoms, 0] *= factor
    model.geom_priority[geoms] = priority
    paired = np.isin(model.pair_geom1, geoms) | np.isin(model.pair_geom2, geoms)
    model.pair_friction[paired, :2] *= factor


def _ground_of(model: mujoco.MjModel, geom: int) -> int | None:
    """Returns the id of the first static geom that a geom can touch; None if there is none."""
    ground = np.flatnonzero(static_geoms(model) & can_touch(model, np.array([geom])))
    return int(ground[0]) if len(ground) else None


def _adopt_contact_parameters(model: mujoco.MjModel, geom: int, other: int) -> None:
    """Writes into a geom the parameters of its contacts with another geom.

    Source: MuJoCo's ``mj_contactParam``.
    """
    own, ground = model.geom_priority[geom], model.geom_priority[other]
    if own > ground:
        return
    if own < ground:
        model.geom_condim[geom] = model.geom_condim[other]
        model.geom_friction[geom] = model.geom_friction[other]
        model.geom_solref[geom] = model.geom_solref[other]
        model.geom_solimp[geom] = model.geom_solimp[other]
        return
    weight = _weight(float(model.geom_solmix[geom]), float(model.geom_solmix[other]))
    model.geom_condim[geom] = max(model.geom_condim[geom], model.geom_condim[other])
    model.geom_friction[geom] = np.maximum(model.geom_friction[geom], model.geom_friction[other])
    one, two = model.geom_solref[geom], model.geom_solref[other]
    standard = one[0] > 0 and two[0] > 0
    model.geom_solref[geom] = (
        weight * one + (1 - weight) * two if standard else np.minimum(one, two)
    )
    model.geom_solimp[geom] = (
        weight * model.geom_solimp[geom] + (1 - weight) * model.geom_solimp[other]
    )


def _weight(own: float, other: float) -> float:
    """Returns the weight of a geom in a mean, given the ``solmix`` of both geoms."""
    if own >= _MIN_MIX and other >= _MIN_MIX:
        return own / (own + other)
    if own < _MIN_MIX and other < _MIN_MIX:
        return 0.5
    return float(own >= _MIN_MIX)


def scale_damping(model: mujoco.MjModel, name: str, factor: float) -> None:
    """Scales the viscous damping of a hinge.

    A hinge without damping has none to scale. Its damping is increased by ``factor - 1`` times the
    damping that slows the hinge, with all that it carries, with a time constant of 1 s.

    Args:
        model: The model, edited in place.
        name: Name of the hinge.
        factor: Factor of the damping.
    """
    dof = int(model.joint(name).dofadr[0])
    if model.dof_damping[dof] or model.dof_dampingpoly[dof].any():
        model.dof_damping[dof] *= factor
        model.dof_dampingpoly[dof] *= factor
    else:
        model.dof_damping[dof] = max(factor - 1, 0.0) * model.dof_M0[dof]


def add_dry_friction(model: mujoco.MjModel, name: str, fraction: float) -> None:
    """Adds dry friction to a hinge.

    Args:
        model: The model, edited in place.
        name: Name of the hinge.
        fraction: The friction, as a fraction of the largest torque of the hinge's motors.
    """
    hinge = model.joint(name)
    model.dof_frictionloss[hinge.dofadr[0]] += fraction * largest_torque(model, int(hinge.id))


def largest_torque(model: mujoco.MjModel, hinge: int) -> float:
    """Returns the largest torque of the motors of a hinge, N m; 0 without motors.

    Without a limit of its force, a motor is assumed to have the gain times the largest command, or
    times 1 without a limit of the command.

    Args:
        model: A compiled model.
        hinge: Id of the hinge.
    """
    torque = sum(
        abs(float(model.actuator_gear[motor, 0])) * _largest_force(model, motor)
        for motor in range(model.nu)
        if hinge in motor_joints(model, motor)
    )
    if model.jnt_actfrclimited[hinge]:
        return min(torque, float(abs(model.jnt_actfrcrange[hinge]).max()))
    return torque


def _largest_force(model: mujoco.MjModel, motor: int) -> float:
    if model.actuator_forcelimited[motor]:
        return float(abs(model.actuator_forcerange[motor]).max())
    limited = model.actuator_ctrllimited[motor]
    command = float(abs(model.actuator_ctrlrange[motor]).max()) if limited else 1.0
    return abs(float(model.actuator_gainprm[motor, 0])) * command


def shift_feedback(model: mujoco.MjModel, name: str, offset: float) -> None:
    """Adds an offset to the angle of a hinge that the servos of its motors measure.

    The force of a motor with an affine bias is ``gain * command + bias[0] + bias[1] * length +
    bias[2] * velocity``. The offset adds ``length_per_angle * offset`` to the length, a constant
    force. A motor without position feedback, such as a torque motor, has a ``bias[1]`` of 0.

    Args:
        model: The model, edited in place.
        name: Name of the hinge.
        offset: Measured minus true angle, rad.
    """
    hinge = int(model.joint(name).id)
    for motor in range(model.nu):
        if has_feedback(model, motor):
            bias = model.actuator_biasprm[motor]
            bias[0] += bias[1] * length_per_angle(model, motor, hinge) * offset


def add_point_mass(model: mujoco.MjModel, name: str, mass: float, offset: FloatArray) -> None:
    """Adds a point mass to a body.

    Args:
        model: The model, edited in place; its layout stays.
        name: Name of the body.
        mass: The mass, kg.
        offset: Position of the mass relative to the body's centre of mass, in the frame of the
            body, ``(3,)``, m; with zeros, the inertia is unchanged to the bit.
    """
    body = model.body(name)
    own = float(body.mass[0])
    body.mass = own + mass
    if not offset.any():
        return
    axes = _matrix(body.iquat)
    # About the common centre of mass, two masses have the inertia of the reduced mass.
    reduced = own * mass / (own + mass)
    inertia = axes @ np.diag(body.inertia) @ axes.T
    inertia += reduced * (offset @ offset * np.eye(3) - np.outer(offset, offset))
    moments, vectors = np.linalg.eigh(inertia)
    vectors[:, 0] *= np.linalg.det(vectors)  # a rotation, not a reflection
    mujoco.mju_mat2Quat(body.iquat, vectors.ravel())
    body.inertia = moments
    body.ipos = body.ipos + offset * mass / (own + mass)


def inertia_box_reach(model: mujoco.MjModel, name: str, direction: FloatArray) -> float:
    """Returns the distance of a body's surface from its centre of mass along a direction, m.

    The body is the box of even density with its mass and inertia.

    Args:
        model: A compiled model.
        name: Name of the body.
        direction: Unit vector in the frame of the body, ``(3,)``.
    """
    body = model.body(name)
    moments = np.asarray(body.inertia)
    squares = 6 * np.maximum(moments.sum() - 2 * moments, 0.0) / float(body.mass[0])
    return float(np.abs(_matrix(body.iquat).T @ direction) @ np.sqrt(squares)) / 2


def _matrix(quaternion: FloatArray) -> FloatArray:
    """Returns the rotation matrix of a quaternion w x y z, ``(3, 3)``."""
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)


def turned_by_hinge(
    position: FloatArray,
    orientation: FloatArray,
    axis: FloatArray,
    anchor: FloatArray,
    angle: float,
) -> tuple[FloatArray, FloatArray]:
    """Returns the frame of a body after a rotation about one of its hinges.

    Args:
        position: Position of the body in its parent's frame, ``(3,)`` m.
        orientation: Orientation of the body in its parent's frame, ``(4,)``, w x y z.
        axis: Axis of the hinge in the body frame, ``(3,)``.
        anchor: Position of the hinge in the body frame, ``(3,)`` m.
        angle: Angle of the rotation, rad.

    Returns:
        The new position, ``(3,)``, and the new orientation, ``(4,)``.
    """
    rotation, rotated = np.empty(4), np.empty(4)
    mujoco.mju_axisAngle2Quat(rotation, axis, angle)
    mujoco.mju_mulQuat(rotated, orientation, rotation)
    before, after = np.empty(3), np.empty(3)
    mujoco.mju_rotVecQuat(before, anchor, orientation)
    mujoco.mju_rotVecQuat(after, anchor, rotated)
    return position + (before - after), rotated


def turn_about_origin(position: FloatArray, orientation: FloatArray, rotation: FloatArray) -> None:
    """Rotates a frame about the origin of its parent frame, in place.

    Args:
        position: Position of the frame, ``(3,)`` m; written.
        orientation: Orientation of the frame, ``(4,)``, w x y z; written.
        rotation: The rotation, ``(4,)``, w x y z.
    """
    mujoco.mju_rotVecQuat(position, position.copy(), rotation)
    mujoco.mju_mulQuat(orientation, rotation, orientation.copy())


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
