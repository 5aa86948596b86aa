"""How the robot stands at the start: its keyframe, turned so that forward is the world's x."""

import math
from dataclasses import dataclass, field
from xml.etree import ElementTree as ET  # of texts that were checked

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.errors import InputError, unknown_name
from selfmodel.robot.mjcf.document import Document
from selfmodel.robot.mjcf.expand import numbers
from selfmodel.robot.mjcf.ground import pairs
from selfmodel.robot.mjcf.mujoco_errors import compiled, told_by_mujoco
from selfmodel.robot.mjcf.settings import DIRECTIONS, NO_KEYFRAME, MjcfSettings

_ORIENTATIONS = ("quat", "axisangle", "xyaxes", "zaxis", "euler")
_SAME = 1e-9
"""How exactly the new reference pose must be that of the keyframe, m and unit quaternions."""
_MET = 1e-6
"""How exactly a keyframe must meet an equality constraint that is to be kept."""


@dataclass
class _Frames:
    """Frames of bodies, and references of joints, that are being changed."""

    position: FloatArray
    orientation: FloatArray
    reference: dict[int, float] = field(default_factory=dict)


def bake_keyframe(document: Document, model: mujoco.MjModel, settings: MjcfSettings) -> None:
    """Makes the keyframe in which the robot starts its reference pose; no keyframe is left.

    Raises:
        InputError: There is no such keyframe, or an equality constraint would mean something else.
    """
    number = _keyframe(model, settings.keyframe)
    for part in document.root.findall("keyframe"):
        document.root.remove(part)
    if number is None:
        return
    qpos = np.array(model.key_qpos[number])
    if not np.array_equal(qpos, model.qpos0):
        with told_by_mujoco():
            before = mujoco.MjData(model)
            before.qpos = qpos
            mujoco.mj_fwdPosition(model, before)
        _check_equalities(model, before)
        _write_tendons(document, model)
        _write_frames(document, model, _posed(model, qpos))
        _check_pose(before, compiled(document.text, document.assets))
    name = model.key(number).name or f"number {number}"
    document.notes.append(f"it starts as in its keyframe {name}")


def turn_forward(document: Document, model: mujoco.MjModel, settings: MjcfSettings) -> None:
    """Turns a floating robot about the vertical until the way it is to walk is the world's x.

    Raises:
        InputError: It does not float, or the world is not the same from all sides.
    """
    angle = -math.radians(DIRECTIONS[settings.forward])
    if not angle:
        return
    root = next((j for j in range(model.njnt) if model.jnt_type[j] == _FREE), None)
    if root is None:
        raise InputError(
            f"forward={settings.forward} needs a root body with a free joint: without one, turn "
            f"the robot in its file until it walks along x"
        )
    if np.any(model.opt.gravity[:2]) or np.any(model.opt.wind[:2]) or not _is_flat(model):
        raise InputError(
            f"forward={settings.forward} turns the robot where it stands, and its world is not "
            f"the same from all sides: turn the robot in its file until it walks along x"
        )
    body = int(model.jnt_bodyid[root])
    frames = _Frames(model.body_pos.copy(), model.body_quat.copy())
    turn, quat = np.array([math.cos(angle / 2), 0, 0, math.sin(angle / 2)]), np.empty(4)
    mujoco.mju_mulQuat(quat, turn, frames.orientation[body])
    frames.orientation[body] = quat
    _write_frames(document, model, frames)
    document.notes.append(f"it is turned at the start, so that its {settings.forward} is forward")


_FREE, _SLIDE = mujoco.mjtJoint.mjJNT_FREE, mujoco.mjtJoint.mjJNT_SLIDE


def _keyframe(model: mujoco.MjModel, wanted: str) -> int | None:
    names = [model.key(k).name for k in range(model.nkey)]
    if wanted == NO_KEYFRAME:
        return None
    if not wanted:
        return 0 if names else None
    if wanted not in names:
        raise unknown_name("keyframe", wanted, [*filter(None, names), NO_KEYFRAME])
    return names.index(wanted)


def _posed(model: mujoco.MjModel, qpos: FloatArray) -> _Frames:
    """The frames in which the bodies stand at ``qpos`` with every joint at its reference."""
    frames = _Frames(model.body_pos.copy(), model.body_quat.copy())
    for joint in range(model.njnt):
        body, place = int(model.jnt_bodyid[joint]), int(model.jnt_qposadr[joint])
        if model.jnt_type[joint] == _FREE:
            frames.position[body] = qpos[place : place + 3]
            frames.orientation[body] = qpos[place + 3 : place + 7]
            continue
        moved = float(qpos[place] - model.qpos0[place])
        frames.reference[joint] = float(qpos[place])
        quat = frames.orientation[body].copy()
        if model.jnt_type[joint] == _SLIDE:
            along = np.empty(3)
            mujoco.mju_rotVecQuat(along, model.jnt_axis[joint], quat)
            frames.position[body] += moved * along
            continue
        turn, turned = np.empty(4), np.empty(4)
        mujoco.mju_axisAngle2Quat(turn, model.jnt_axis[joint], moved)
        mujoco.mju_mulQuat(turned, quat, turn)
        before, after = np.empty(3), np.empty(3)
        mujoco.mju_rotVecQuat(before, model.jnt_pos[joint], quat)
        mujoco.mju_rotVecQuat(after, model.jnt_pos[joint], turned)
        frames.position[body] += before - after
        frames.orientation[body] = turned
    return frames


def _write_frames(document: Document, model: mujoco.MjModel, frames: _Frames) -> None:
    elements = {element.get("name"): element for element in document.bodies()}
    for body in range(1, model.nbody):
        element = elements[model.body(body).name]
        if not np.array_equal(frames.position[body], model.body_pos[body]):
            element.set("pos", numbers(frames.position[body]))
        if not np.array_equal(frames.orientation[body], model.body_quat[body]):
            for attribute in _ORIENTATIONS:
                element.attrib.pop(attribute, None)
            element.set("quat", numbers(frames.orientation[body]))
    joints = {j.get("name"): j for body in elements.values() for j in body if j.tag == "joint"}
    for joint, reference in frames.reference.items():
        _write_reference(document, model, joints[model.joint(joint).name], joint, reference)


def _write_reference(
    document: Document, model: mujoco.MjModel, element: ET.Element, joint: int, reference: float
) -> None:
    if reference == model.qpos0[model.jnt_qposadr[joint]]:
        return
    unit = 1.0 if model.jnt_type[joint] == _SLIDE else document.angle_unit
    element.set("ref", repr(reference * unit))


def _check_equalities(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Equality constraints are meant relative to the reference pose, which is to change."""
    if not model.neq:
        return
    rows = data.efc_type[: data.nefc] == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    coupling = (int(mujoco.mjtEq.mjEQ_JOINT), int(mujoco.mjtEq.mjEQ_TENDON))
    curved = [
        eq
        for eq in range(model.neq)
        if int(model.eq_type[eq]) in coupling and np.any(model.eq_data[eq, 2:5])
    ]
    if curved or np.any(np.abs(data.efc_pos[: data.nefc][rows]) > _MET):
        raise InputError(
            f"its equality constraints are not met, or not alike, in its keyframe: start it in "
            f"another with keyframe=NAME, or in its reference pose with keyframe={NO_KEYFRAME}"
        )


def _write_tendons(document: Document, model: mujoco.MjModel) -> None:
    """Keeps the lengths at which tendons are slack: to the world, as the root's pose makes them."""
    for tendon, element in enumerate(document.children("tendon")):
        if model.tendon_stiffness[tendon]:
            element.set("springlength", numbers(model.tendon_lengthspring[tendon]))


def _check_pose(before: mujoco.MjData, model: mujoco.MjModel) -> None:
    after = mujoco.MjData(model)
    mujoco.mj_kinematics(model, after)
    turned = np.abs(np.sum(before.xquat * after.xquat, axis=1))
    if not (
        np.allclose(before.xpos, after.xpos, atol=_SAME) and np.allclose(turned, 1, atol=_SAME)
    ):
        raise InputError(
            f"its keyframe cannot be made its reference pose: start it in another with "
            f"keyframe=NAME, or in its reference pose with keyframe={NO_KEYFRAME}"
        )


def _is_flat(model: mujoco.MjModel) -> bool:
    """Whether all that stands in the world and can be touched is level ground."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    paired = {geom for pair in pairs(model) for geom in pair}
    for geom in range(model.ngeom):
        moves = model.body_weldid[model.geom_bodyid[geom]] != 0
        touched = geom in paired or model.geom_contype[geom] | model.geom_conaffinity[geom]
        if moves or not touched:
            continue
        level = np.allclose(data.geom_xmat[geom, 2::3], (0, 0, 1), rtol=0, atol=_SAME)
        if model.geom_type[geom] != mujoco.mjtGeom.mjGEOM_PLANE or not level:
            return False
    return True
