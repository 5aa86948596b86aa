"""What viewers of a log need: the model as URDF, and the pose of each body in its parent's frame.

Links have the names of the frames on ``/tf``. Hinges and slides become joints; a body without a
joint is fixed to its parent. A hinge that does not pass through the origin of its body, or that
shares its body with other hinges, gets an intermediate link without mass. Ground and meshes are
left out; a capsule becomes a cylinder of its length.
"""

import math
from collections.abc import Mapping, Sequence
from xml.etree import ElementTree as ET

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.logs.messages import WORLD, XYZW, Part, transforms
from selfmodel.robot.motion import POSE, Shape, body_poses, shapes_of
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import state_writer
from selfmodel.rotation import in_body_frame, product, rotated

_JOINTS = {
    int(mujoco.mjtJoint.mjJNT_HINGE): "revolute",
    int(mujoco.mjtJoint.mjJNT_SLIDE): "prismatic",
}


def urdf(robot: Robot) -> str:
    """Returns the model of a robot as URDF; the root link is the robot's root body."""
    model = robot.model
    names = ("world", *body_names(model))
    root = model.body(robot.root).id
    tree = ET.Element("robot", name=robot.name)
    kept = {root}
    for body in range(root, model.nbody):
        parent = int(model.body_parentid[body])
        if body != root and parent not in kept:
            continue
        kept.add(body)
        if body != root:
            _joints(tree, model, body, names[parent], names[body])
        _link(tree, model, body, names[body])
    ET.indent(tree)
    return ET.tostring(tree, encoding="unicode")


def _joints(tree: ET.Element, model: mujoco.MjModel, body: int, parent: str, name: str) -> None:
    """Adds the chain of joints and massless links from the parent of a body to the body."""
    first = int(model.body_jntadr[body])
    joints = [
        model.joint(j)
        for j in range(first, first + int(model.body_jntnum[body]))
        if int(model.jnt_type[j]) in _JOINTS
    ]
    offset, turn = model.body_pos[body], model.body_quat[body]
    anchor = np.zeros(3)
    for joint in joints:
        at_end = joint is joints[-1] and not np.any(joint.pos)
        child = name if at_end else f"{name}__{joint.name}"
        if not at_end:
            ET.SubElement(tree, "link", name=child)
        element = _joint(tree, joint.name, _JOINTS[int(joint.type[0])], parent, child)
        # From the second joint on, from one anchor to the next within the body's frame.
        _origin(element, offset + rotated(joint.pos - anchor, turn), turn)
        ET.SubElement(element, "axis", xyz=_text(joint.axis))
        _limit(element, model, joint.id)
        parent, anchor = child, joint.pos
        offset, turn = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
    if parent != name:
        element = _joint(tree, f"{name}__fixed", "fixed", parent, name)
        _origin(element, offset - anchor, turn)


def _joint(tree: ET.Element, name: str, kind: str, parent: str, child: str) -> ET.Element:
    element = ET.SubElement(tree, "joint", name=name, type=kind)
    ET.SubElement(element, "parent", link=parent)
    ET.SubElement(element, "child", link=child)
    return element


def _limit(element: ET.Element, model: mujoco.MjModel, joint: int) -> None:
    if not model.jnt_limited[joint] and element.get("type") == "revolute":
        element.set("type", "continuous")
        return
    low, high = model.jnt_range[joint] if model.jnt_limited[joint] else (-1e3, 1e3)
    # URDF requires an effort and a velocity; viewers ignore both.
    ET.SubElement(
        element, "limit", lower=f"{low:.9g}", upper=f"{high:.9g}", effort="1000", velocity="100"
    )


def _link(tree: ET.Element, model: mujoco.MjModel, body: int, name: str) -> None:
    link = ET.SubElement(tree, "link", name=name)
    inertial = ET.SubElement(link, "inertial")
    _origin(inertial, model.body_ipos[body], model.body_iquat[body])
    ET.SubElement(inertial, "mass", value=f"{model.body_mass[body]:.9g}")
    xx, yy, zz = (f"{value:.9g}" for value in model.body_inertia[body])
    ET.SubElement(inertial, "inertia", ixx=xx, iyy=yy, izz=zz, ixy="0", ixz="0", iyz="0")
    first = int(model.body_geomadr[body])
    geoms = np.arange(first, first + int(model.body_geomnum[body]))
    for shape in shapes_of(model, geoms):
        geometry = _geometry(shape)
        if geometry is None:
            continue
        visual = ET.SubElement(link, "visual")
        _origin(visual, shape.position, shape.quaternion)
        ET.SubElement(visual, "geometry").append(geometry)
        material = ET.SubElement(visual, "material", name=f"{name}_{shape.geom}")
        ET.SubElement(material, "color", rgba=_text(model.geom_rgba[shape.geom]))


def _geometry(shape: Shape) -> ET.Element | None:
    radius, half = shape.size[:2]
    match shape.kind:
        case "box":
            return ET.Element("box", size=_text(2 * shape.size))
        case "sphere":
            return ET.Element("sphere", radius=f"{radius:.9g}")
        case "cylinder":
            return ET.Element("cylinder", radius=f"{radius:.9g}", length=f"{2 * half:.9g}")
        case "capsule":
            length = f"{2 * (half + radius):.9g}"
            return ET.Element("cylinder", radius=f"{radius:.9g}", length=length)
    return None


def _origin(element: ET.Element, offset: FloatArray, turn: FloatArray) -> None:
    ET.SubElement(element, "origin", xyz=_text(offset), rpy=_text(_roll_pitch_yaw(turn)))


def _roll_pitch_yaw(quaternion: FloatArray) -> tuple[float, float, float]:
    """Returns URDF's fixed-axis angles of a rotation, rad."""
    w, x, y, z = (float(value) for value in quaternion)
    sine = 2 * (w * y - x * z)
    if abs(sine) > 1 - 1e-9:  # gimbal lock
        return 0.0, math.copysign(math.pi / 2, sine), -math.copysign(2, sine) * math.atan2(x, w)
    return (
        math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
        math.asin(sine),
        math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
    )


def _text(values: Sequence[float] | FloatArray) -> str:
    return " ".join(f"{value:.9g}" for value in values)


def body_names(model: mujoco.MjModel) -> tuple[str, ...]:
    """Returns the names of all bodies but the world, which are the names of their frames."""
    return tuple(model.body(b).name or f"body_{b}" for b in range(1, model.nbody))


class Kinematics:
    """Forward kinematics of a robot without faults, like ROS's robot_state_publisher.

    Attributes:
        topics: Topics of the transforms of all bodies, and of all but the root body, for steps in
            which the base was not observed.
    """

    def __init__(self, robot: Robot) -> None:
        self._model = robot.model
        self._data = mujoco.MjData(robot.model)  # once: its memory takes longer than its use
        names = (WORLD, *body_names(self._model))
        bodies, parents = names[1:], [names[parent] for parent in self._model.body_parentid[1:]]
        every = range(len(bodies))
        self._fixed = robot.has_fixed_base
        self._columns = [list(every), [body for body in every if bodies[body] != robot.root]]
        self.topics = [
            transforms([bodies[k] for k in chosen], [parents[k] for k in chosen])
            for chosen in self._columns
        ]
        # A joint that is not observed keeps its last position.
        self._qpos = robot.model.qpos0[np.newaxis].copy()
        fields = {"qpos": self._qpos, "qvel": np.zeros((1, robot.model.nv))}
        self._write = state_writer(robot, fields.__getitem__)

    def transforms(self, rows: Mapping[Part, FloatArray]) -> list[tuple[IndexArray, FloatArray]]:
        """Returns the pose of each body in the frame of its parent, given the signals of ``POSE``.

        Returns:
            For each of ``topics``, the steps of its messages, and of these the position x y z in
            metres and the quaternion x y z w of each of its bodies, ``(steps, 7 bodies)``, rounded
            by ``to_micrometres``.
        """
        base = np.concatenate([rows["base_position"], rows["base_orientation"]], axis=1)
        known = np.isfinite(base).all(axis=1) | self._fixed
        qpos = np.empty((len(base), self._model.nq))
        for k, row in enumerate(qpos):
            observed = POSE if known[k] else POSE[:1]
            self._write({signal: rows[signal][k : k + 1] for signal in observed})
            row[:] = self._qpos[0]
        poses = body_poses(self._data, qpos)
        parents, children = poses[:, self._model.body_parentid[1:]], poses[:, 1:]
        with np.errstate(over="ignore", invalid="ignore"):  # unobserved or extreme values
            moved = in_body_frame(children[..., :3] - parents[..., :3], parents[..., 3:])
            turned = product(parents[..., 3:] * _INVERSE, children[..., 3:])
        relative = to_micrometres(np.concatenate([moved, turned[..., XYZW]], axis=-1))
        steps = np.flatnonzero(known), np.flatnonzero(~known)
        return [
            (chosen, relative[chosen][:, columns].reshape(len(chosen), 7 * len(columns)))
            for chosen, columns in zip(steps, self._columns, strict=True)
        ]


_INVERSE = (1.0, -1.0, -1.0, -1.0)


def to_micrometres(values: FloatArray) -> FloatArray:
    """Returns numbers rounded to multiples of 2**-20: a micrometre, or a microradian.

    Rounding is for derived numbers, which are only displayed: constant values compress to almost
    nothing.
    """
    with np.errstate(over="ignore"):  # unobserved or extreme values
        rounded: FloatArray = np.rint(values * 2.0**20) / 2.0**20
    return rounded + 0.0  # 0 is 0, never -0
