"""Motion of a robot as it is drawn: its poses along recorded states, and the shapes of its geoms.

Logs, the report, films and Rerun draw the same poses and shapes.
"""

from dataclasses import dataclass
from typing import Literal

import mujoco
import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray, held
from selfmodel.robot.contacts import touching_geoms
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import state_writer, with_known_base
from selfmodel.rotation import rotated
from selfmodel.trials.signals import Signal
from selfmodel.trials.trajectory import Trajectory

POSE: tuple[Signal, ...] = ("joint_positions", "base_position", "base_orientation")
"""Signals that determine a pose."""

VISUAL_GROUPS = 3
"""Groups 0, 1 and 2 are drawn by MuJoCo's viewer; Menagerie has collision geoms in group 3."""

DEFAULT_RGBA = (0.5, 0.5, 0.5, 1.0)
"""Colour of a geom that leaves the colour to its material."""

_ENOUGH = 0.5
"""Smallest size of the chosen geoms of a body, as a fraction of the size of all of them."""

ShapeKind = Literal["sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh"]

_KINDS: dict[int, ShapeKind] = {
    mujoco.mjtGeom.mjGEOM_SPHERE: "sphere",
    mujoco.mjtGeom.mjGEOM_CAPSULE: "capsule",
    mujoco.mjtGeom.mjGEOM_ELLIPSOID: "ellipsoid",
    mujoco.mjtGeom.mjGEOM_CYLINDER: "cylinder",
    mujoco.mjtGeom.mjGEOM_BOX: "box",
    mujoco.mjtGeom.mjGEOM_MESH: "mesh",
}

_GROUND = (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD)


@dataclass(frozen=True, eq=False)
class Poses:
    """Pose of a robot at each step.

    Attributes:
        qpos: Positions of the model, ``(steps, nq)``; the last observation where one is missing.
        held: Steps at which an observation is missing, ``(steps,)``.
        missing: Hinges, ``base_position`` and ``base_orientation`` without any observation; they
            are as in the reference pose.
        forward: Position of the base along the world's x axis, ``(steps,)``, m; NaN where it was
            not observed.
    """

    qpos: FloatArray
    held: BoolArray
    missing: tuple[str, ...]
    forward: FloatArray


def poses_of(robot: Robot, model: mujoco.MjModel, trajectory: Trajectory) -> Poses:
    """Returns the poses of a trajectory; the base of a robot that is fixed is known.

    A missing value is the last observation before it, or the first one. The trajectory is one run
    with the signals of ``POSE``; positions in no signal are as in the model's reference pose.
    """
    trajectory = with_known_base(robot, trajectory)
    held_steps = np.zeros(trajectory.steps, dtype=bool)
    missing: list[str] = []
    state: dict[Signal, FloatArray] = {}
    for signal in POSE:
        values = trajectory[signal]
        seen = np.isfinite(values)
        if signal != "joint_positions":
            # A position or a quaternion with a missing component is missing.
            seen[:] = seen.all(axis=1, keepdims=True)
        known: BoolArray = np.any(seen, axis=0)
        held_steps |= (~seen & known).any(axis=1)
        if signal == "joint_positions":
            names = trajectory.names.columns(signal)
            missing += [name for column, name in enumerate(names) if not known[column]]
            reference = [float(model.joint(name).qpos0[0]) for name in names]
            state[signal] = np.where(known, _filled(values, seen), reference)
        elif known.all():
            state[signal] = _filled(values, seen)
        else:
            missing.append(signal)
    qpos = np.tile(model.qpos0, (trajectory.steps, 1))
    unmoved = np.zeros((trajectory.steps, model.nv))
    state_writer(robot, {"qpos": qpos, "qvel": unmoved}.__getitem__, model)(state)
    return Poses(qpos, held_steps, tuple(missing), trajectory["base_position"][:, 0])


def body_poses(data: mujoco.MjData, qpos: FloatArray) -> FloatArray:
    """Returns the poses of the bodies of the model of ``data`` along positions, ``(steps, nq)``.

    They are positions x y z, m, and quaternions w x y z in the world, ``(steps, nbody, 7)``.
    """
    poses = np.empty((len(qpos), data.model.nbody, 7))
    for row, pose in zip(qpos, poses, strict=True):
        data.qpos[:] = row
        mujoco.mj_kinematics(data.model, data)
        pose[:, :3], pose[:, 3:] = data.xpos, data.xquat
    return poses


def bodies_of(model: mujoco.MjModel, root: str) -> IndexArray:
    """Returns the ids of the bodies of a robot's kinematic tree, ``(bodies,)``."""
    return np.flatnonzero(model.body_rootid == model.body_rootid[model.body(root).id])


@dataclass(frozen=True, eq=False)
class Shape:
    """A geom as it is drawn.

    Attributes:
        kind: Its form; a geom of another type is its bounding box.
        size: As of MuJoCo's geoms, ``(3,)``, m: radii, or half lengths along z and of a box.
        position: Position in the body's frame, ``(3,)``, m.
        quaternion: Orientation in the body's frame, w x y z.
        mesh: Id of the mesh; -1 for a form without one.
    """

    geom: int
    body: int
    kind: ShapeKind
    size: FloatArray
    position: FloatArray
    quaternion: FloatArray
    mesh: int = -1


def shapes_of(model: mujoco.MjModel, geoms: IndexArray) -> list[Shape]:
    """Returns geoms as shapes, in their order, without the ground."""
    return [_shape(model, int(geom)) for geom in geoms if model.geom_type[geom] not in _GROUND]


def _shape(model: mujoco.MjModel, geom: int) -> Shape:
    kind = _KINDS.get(int(model.geom_type[geom]))
    place: tuple[int, int] = geom, int(model.geom_bodyid[geom])
    position, quaternion = model.geom_pos[geom], model.geom_quat[geom]
    if kind is None:
        middle, reach = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
        return Shape(*place, "box", reach, position + rotated(middle, quaternion), quaternion)
    mesh = int(model.geom_dataid[geom]) if kind == "mesh" else -1
    return Shape(*place, kind, model.geom_size[geom], position, quaternion, mesh)


def triangles_of(model: mujoco.MjModel, mesh: int) -> tuple[FloatArray, IndexArray]:
    """Returns the vertices of a mesh, ``(vertices, 3)`` m, and its faces, ``(faces, 3)``."""
    vertex, face = int(model.mesh_vertadr[mesh]), int(model.mesh_faceadr[mesh])
    vertices = model.mesh_vert[vertex : vertex + int(model.mesh_vertnum[mesh])]
    faces = model.mesh_face[face : face + int(model.mesh_facenum[mesh])]
    return vertices.astype(float), faces.astype(np.intp)


def visible_geoms(model: mujoco.MjModel) -> BoolArray:
    """Returns whether each geom is drawn, ``(ngeom,)``.

    The geoms of a body in the visual groups are drawn, without those for contacts if there are
    visual meshes in another group. All geoms of a body are drawn if these are less than half as
    large as the body: a limb without visual geoms, or a head of which only the eyes would be seen.
    """
    seen = (model.geom_group < VISUAL_GROUPS) & (opacity(model) > 0)
    return _or_whole_bodies(model, seen & ~_covered(model, seen))


def stick_geoms(model: mujoco.MjModel) -> BoolArray:
    """Returns whether each geom is drawn in a stick figure, ``(ngeom,)``.

    A mesh, whose bounding box would be drawn, is left out if the body has other geoms.
    """
    return _or_whole_bodies(model, model.geom_type != mujoco.mjtGeom.mjGEOM_MESH)


def opacity(model: mujoco.MjModel) -> FloatArray:
    """Returns the opacity of each geom, of its own colour or of its material, ``(ngeom,)``."""
    own: FloatArray = model.geom_rgba[:, 3].astype(float)
    by_material = (model.geom_matid >= 0) & (model.geom_rgba == DEFAULT_RGBA).all(axis=1)
    own[by_material] = model.mat_rgba[model.geom_matid[by_material], 3]
    return own


def _or_whole_bodies(model: mujoco.MjModel, chosen: BoolArray) -> BoolArray:
    """Returns the chosen geoms, and all geoms of bodies with too few of them."""
    size = np.linalg.norm(model.geom_pos, axis=1) + model.geom_rbound
    size[model.geom_rbound == 0] = np.inf  # a plane
    whole, part = np.zeros(model.nbody), np.full(model.nbody, -1.0)
    np.maximum.at(whole, model.geom_bodyid, size)
    np.maximum.at(part, model.geom_bodyid[chosen], size[chosen])
    return np.asarray(chosen | (part < _ENOUGH * whole)[model.geom_bodyid])


def _covered(model: mujoco.MjModel, seen: BoolArray) -> BoolArray:
    """Returns whether each geom is the collision geom of a body with a mesh to be drawn instead."""
    collides = touching_geoms(model)
    covered = np.zeros(model.ngeom, dtype=bool)
    meshes = (model.geom_type == mujoco.mjtGeom.mjGEOM_MESH) & ~collides
    for geom in np.flatnonzero(meshes & seen):
        same_body = model.geom_bodyid == model.geom_bodyid[geom]
        covered |= same_body & collides & (model.geom_group != model.geom_group[geom])
    return covered


def _filled(values: FloatArray, seen: BoolArray) -> FloatArray:
    """Returns each value, or else the last observation before it, or else the first one."""
    forward = held(np.where(seen, values, np.nan))
    return np.where(np.isfinite(forward), forward, held(forward[::-1])[::-1])
