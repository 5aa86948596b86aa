"""Geometry of a robot in a page: its bodies, and the shapes on them, from its own model."""

from collections.abc import Iterator, Mapping
from typing import Any

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.report.encoding import base64_of, quantised
from selfmodel.report.meshes import Triangles, simplified
from selfmodel.robot.robot import Robot
from selfmodel.robot.visible_geoms import visible_geoms

MAX_FACES = 40_000
"""Triangles of all meshes of a robot, at most."""

MIN_FACES = 200
"""Triangles that each mesh may have, however many meshes there are."""

SHAPES: Mapping[int, str] = {
    mujoco.mjtGeom.mjGEOM_SPHERE: "sphere",
    mujoco.mjtGeom.mjGEOM_CAPSULE: "capsule",
    mujoco.mjtGeom.mjGEOM_ELLIPSOID: "ellipsoid",
    mujoco.mjtGeom.mjGEOM_CYLINDER: "cylinder",
    mujoco.mjtGeom.mjGEOM_BOX: "box",
    mujoco.mjtGeom.mjGEOM_MESH: "mesh",
}
"""Shapes that are drawn, by type of a geom; the ground is drawn by the page."""


def bodies_of(robot: Robot) -> IndexArray:
    """Returns the ids of a robot's bodies, ``(bodies,)``: those of its kinematic tree."""
    model = robot.model
    root = int(model.body(robot.root).id)
    return np.flatnonzero(model.body_rootid == model.body_rootid[root])


def geometry_of(robot: Robot) -> dict[str, Any]:
    """Returns the bodies, shapes, meshes and hinges of a robot as JSON values.

    Positions are m; quaternions are w x y z. A shape's position and quaternion are in its body's
    frame, its size is that of MuJoCo's geom. ``hinges`` are all hinges by name, ``turned`` those of
    bodies with a single one: the rotation of such a body relative to its parent is ``rest`` at the
    angle ``reference``, and turns about ``axis``.
    """
    model = robot.model
    bodies = bodies_of(robot)
    index = {int(body): i for i, body in enumerate(bodies)}
    shapes = [
        int(geom)
        for geom in np.flatnonzero(visible_geoms(model))
        if int(model.geom_bodyid[geom]) in index and int(model.geom_type[geom]) in SHAPES
    ]
    meshes = sorted({int(model.geom_dataid[geom]) for geom in shapes if _is_mesh(model, geom)})
    faces = max(MIN_FACES, MAX_FACES // max(1, len(meshes)))
    return {
        "bodies": [str(model.body(body).name) for body in bodies],
        "shapes": [
            {
                "body": index[int(model.geom_bodyid[geom])],
                "type": SHAPES[int(model.geom_type[geom])],
                "size": model.geom_size[geom].tolist(),
                "position": model.geom_pos[geom].tolist(),
                "quaternion": model.geom_quat[geom].tolist(),
                "mesh": meshes.index(int(model.geom_dataid[geom])) if _is_mesh(model, geom) else -1,
            }
            for geom in shapes
        ],
        "meshes": [_mesh(simplified(_triangles(model, mesh), faces)) for mesh in meshes],
        "hinges": list(robot.anatomy.hinges),
        "turned": list(_turned(robot, index)),
        "height": robot.standing_height,
        "root": index[int(model.body(robot.root).id)],
    }


def _is_mesh(model: mujoco.MjModel, geom: int) -> bool:
    return bool(model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH)


def _triangles(model: mujoco.MjModel, mesh: int) -> Triangles:
    vertex, face = int(model.mesh_vertadr[mesh]), int(model.mesh_faceadr[mesh])
    vertices: FloatArray = model.mesh_vert[vertex : vertex + int(model.mesh_vertnum[mesh])]
    faces = model.mesh_face[face : face + int(model.mesh_facenum[mesh])]
    return Triangles(vertices.astype(float), faces.astype(np.intp))


def _mesh(mesh: Triangles) -> dict[str, Any]:
    return {"vertices": quantised(mesh.vertices), "faces": base64_of(mesh.faces.astype("<u4"))}


def _turned(robot: Robot, index: Mapping[int, int]) -> Iterator[dict[str, Any]]:
    """Yields the hinges whose angle alone turns one body relative to its parent."""
    model = robot.model
    for name in robot.anatomy.hinges:
        hinge = model.joint(name)
        body = int(hinge.bodyid[0])
        parent = int(model.body_parentid[body])
        if model.body_jntnum[body] == 1 and parent in index:
            yield {
                "name": name,
                "body": index[body],
                "parent": index[parent],
                "axis": hinge.axis.tolist(),
                "reference": float(hinge.qpos0[0]),
                "rest": model.body_quat[body].tolist(),
            }
