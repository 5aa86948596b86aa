"""Initial pose of an MJCF: its keyframe becomes the reference pose, its forward direction x."""

import math

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.errors import InputError, unknown_name
from selfmodel.robot.contacts import static_geoms, touching_geoms
from selfmodel.robot.mjcf.document import BodyFrames, Document, format_numbers
from selfmodel.robot.mjcf.settings import FORWARD_DIRECTIONS, NO_KEYFRAME, MjcfSettings
from selfmodel.robot.model_edits import turned_by_hinge
from selfmodel.robot.mujoco_errors import loading_a_model

STANDING_KEYFRAMES = ("home", "stand", "standing")
"""Usual names of the keyframe in which a robot stands, in the order in which they are tried."""

_POSE_TOLERANCE = 1e-9
"""Largest difference of the new reference pose from the keyframe, m and unit quaternions."""

_EQUALITY_TOLERANCE = 1e-6
"""Largest violation of an equality constraint in the keyframe, m or rad."""

_COUPLINGS = (int(mujoco.mjtEq.mjEQ_JOINT), int(mujoco.mjtEq.mjEQ_TENDON))
"""Equality constraints with a polynomial of the distances from the reference pose."""

_OTHER_KEYFRAME = (
    f"start the robot in another keyframe with keyframe=NAME, or in the reference pose with "
    f"keyframe={NO_KEYFRAME}"
)


def bake_keyframe(document: Document, settings: MjcfSettings) -> None:
    """Makes the initial keyframe the reference pose, and removes all keyframes.

    Args:
        document: The MJCF, edited in place.
        settings: Settings with the name of the keyframe.

    Raises:
        InputError: The keyframe does not exist, or an equality constraint would change.
    """
    model = document.model
    number = _keyframe(model, settings.keyframe)
    for part in document.root.findall("keyframe"):
        document.root.remove(part)
    if number is None:
        return
    qpos = np.array(model.key_qpos[number])
    if not np.array_equal(qpos, model.qpos0):
        with loading_a_model():
            before = mujoco.MjData(model)
            before.qpos = qpos
            mujoco.mj_fwdPosition(model, before)
        _check_equalities(model, before)
        _write_spring_lengths(document, model)
        _write_couplings(document, model)
        _frames_at(model, qpos).write(document, model)
        _check_pose(before, document.model)
    name = model.key(number).name or f"number {number}"
    document.notes.append(f"the initial pose is the keyframe {name}")


def _keyframe(model: mujoco.MjModel, wanted: str) -> int | None:
    """Returns the number of the keyframe, or None for the reference pose."""
    names = [model.key(k).name for k in range(model.nkey)]
    if wanted == NO_KEYFRAME:
        return None
    if not wanted:
        usual = next((names.index(name) for name in STANDING_KEYFRAMES if name in names), 0)
        return usual if names else None
    if wanted not in names:
        raise unknown_name("keyframe", wanted, [*filter(None, names), NO_KEYFRAME])
    return names.index(wanted)


def _frames_at(model: mujoco.MjModel, qpos: FloatArray) -> BodyFrames:
    """Returns frames and references for which the reference pose is ``qpos``."""
    frames = BodyFrames.of(model)
    for joint in range(model.njnt):
        body, address = int(model.jnt_bodyid[joint]), int(model.jnt_qposadr[joint])
        if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE:
            frames.position[body] = qpos[address : address + 3]
            frames.orientation[body] = qpos[address + 3 : address + 7]
            continue
        shift = float(qpos[address] - model.qpos0[address])
        frames.reference[joint] = float(qpos[address])
        if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE:
            direction = np.empty(3)
            mujoco.mju_rotVecQuat(direction, model.jnt_axis[joint], frames.orientation[body])
            frames.position[body] += shift * direction
            continue
        frames.position[body], frames.orientation[body] = turned_by_hinge(
            frames.position[body],
            frames.orientation[body],
            model.jnt_axis[joint],
            model.jnt_pos[joint],
            shift,
        )
    return frames


def _check_equalities(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Checks that the new reference pose does not change the equality constraints."""
    if not model.neq:
        return
    rows = data.efc_type[: data.nefc] == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    nonlinear = [
        eq
        for eq in range(model.neq)
        if int(model.eq_type[eq]) in _COUPLINGS and np.any(model.eq_data[eq, 2:5])
    ]
    if nonlinear or np.any(np.abs(data.efc_pos[: data.nefc][rows]) > _EQUALITY_TOLERANCE):
        raise InputError(
            f"equality constraints are violated in the keyframe, or are nonlinear: "
            f"{_OTHER_KEYFRAME}"
        )


def _write_spring_lengths(document: Document, model: mujoco.MjModel) -> None:
    """Writes the rest lengths of sprung tendons, whose default depends on the reference pose."""
    for tendon, element in enumerate(document.children("tendon")):
        if model.tendon_stiffness[tendon]:
            element.set("springlength", format_numbers(model.tendon_lengthspring[tendon]))


def _write_couplings(document: Document, model: mujoco.MjModel) -> None:
    """Removes the offsets of linear couplings, which hold in the new reference pose without one."""
    for eq, element in enumerate(document.children("equality")):
        if int(model.eq_type[eq]) in _COUPLINGS and model.eq_data[eq, 0]:
            coefficients = np.array([0.0, model.eq_data[eq, 1], 0.0, 0.0, 0.0])
            element.set("polycoef", format_numbers(coefficients))


def _check_pose(before: mujoco.MjData, model: mujoco.MjModel) -> None:
    """Checks that the bodies in the reference pose of a model have the poses of ``before``."""
    after = mujoco.MjData(model)
    mujoco.mj_kinematics(model, after)
    alignment = np.abs(np.sum(before.xquat * after.xquat, axis=1))
    if not (
        np.allclose(before.xpos, after.xpos, atol=_POSE_TOLERANCE)
        and np.allclose(alignment, 1, atol=_POSE_TOLERANCE)
    ):
        raise InputError(f"the keyframe cannot be made the reference pose: {_OTHER_KEYFRAME}")


_LEVEL_TOLERANCE = 1e-9
"""Largest deviation of the ground's unit normal from the vertical, per component."""


def turn_forward(document: Document, settings: MjcfSettings) -> None:
    """Rotates a floating robot until its forward direction is the world's x axis.

    Args:
        document: The MJCF, edited in place.
        settings: Settings with the forward direction.

    Raises:
        InputError: The robot has no free joint, or the rotation would change its world.
    """
    angle = -math.radians(FORWARD_DIRECTIONS[settings.forward])
    if not angle:
        return
    model, free = document.model, mujoco.mjtJoint.mjJNT_FREE
    root = next((j for j in range(model.njnt) if model.jnt_type[j] == free), None)
    if root is None:
        raise InputError(
            f"forward={settings.forward} needs a root body with a free joint, got none: rotate the "
            f"robot in its file, so that x is forward"
        )
    if np.any(model.opt.gravity[:2]) or np.any(model.opt.wind[:2]) or not _is_flat(model):
        raise InputError(
            f"forward={settings.forward} rotates the robot, and its world is not the same from all "
            f"sides: rotate the robot in its file, so that x is forward"
        )
    body = int(model.jnt_bodyid[root])
    frames = BodyFrames.of(model)
    rotation = np.array([math.cos(angle / 2), 0, 0, math.sin(angle / 2)])
    orientation = np.empty(4)
    mujoco.mju_mulQuat(orientation, rotation, frames.orientation[body])
    frames.orientation[body] = orientation
    frames.write(document, model)
    document.notes.append(f"the initial pose is rotated, so that {settings.forward} is forward")


def _is_flat(model: mujoco.MjModel) -> bool:
    """Returns whether all static geoms that can be touched are level planes."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for geom in np.flatnonzero(static_geoms(model) & touching_geoms(model)):
        level = np.allclose(data.geom_xmat[geom, 2::3], (0, 0, 1), rtol=0, atol=_LEVEL_TOLERANCE)
        if model.geom_type[geom] != mujoco.mjtGeom.mjGEOM_PLANE or not level:
            return False
    return True
