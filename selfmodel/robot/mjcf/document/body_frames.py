"""Body frames and joint references of an MJCF document."""

from dataclasses import dataclass, field
from xml.etree import ElementTree as ET  # of checked texts

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.robot.mjcf.document.document import Document
from selfmodel.robot.mjcf.document.expand import format_numbers

_ORIENTATION_ATTRIBUTES = ("quat", "axisangle", "xyaxes", "zaxis", "euler")


@dataclass
class BodyFrames:
    """Frames of all bodies and references of joints, to be changed and written into a document.

    Attributes:
        position: Position of each body in its parent's frame, ``(bodies, 3)`` m.
        orientation: Orientation of each body in its parent's frame, ``(bodies, 4)``, w x y z.
        reference: New reference of joints by their ids, m or rad.
    """

    position: FloatArray
    orientation: FloatArray
    reference: dict[int, float] = field(default_factory=dict)

    @classmethod
    def of(cls, model: mujoco.MjModel) -> "BodyFrames":
        """Returns a copy of the frames of a model."""
        return cls(model.body_pos.copy(), model.body_quat.copy())


def write_frames(document: Document, model: mujoco.MjModel, frames: BodyFrames) -> None:
    """Writes the frames and references that differ from those of the compiled document.

    Args:
        document: The MJCF, edited in place.
        model: The compiled document.
        frames: The new frames and references.
    """
    elements = {element.get("name"): element for element in document.bodies()}
    for body in range(1, model.nbody):
        element = elements[model.body(body).name]
        if not np.array_equal(frames.position[body], model.body_pos[body]):
            element.set("pos", format_numbers(frames.position[body]))
        if not np.array_equal(frames.orientation[body], model.body_quat[body]):
            for attribute in _ORIENTATION_ATTRIBUTES:
                element.attrib.pop(attribute, None)
            element.set("quat", format_numbers(frames.orientation[body]))
    joints = {j.get("name"): j for body in elements.values() for j in body if j.tag == "joint"}
    for joint, reference in frames.reference.items():
        _write_reference(document, model, joints[model.joint(joint).name], joint, reference)


def _write_reference(
    document: Document, model: mujoco.MjModel, element: ET.Element, joint: int, reference: float
) -> None:
    if reference == model.qpos0[model.jnt_qposadr[joint]]:
        return
    is_slide = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE
    unit = 1.0 if is_slide else document.angle_unit
    element.set("ref", repr(reference * unit))
