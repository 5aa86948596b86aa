"""The robots of a report on one timeline, as JSON: bodies with their shapes, and poses over time.

Poses are by forward kinematics of the robot's own model. Arrays are bytes of 16-bit numbers, which
are base64 in JSON.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.faults.build import build, detached_bodies, jammed_bodies
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.robot.motion import (
    bodies_of,
    body_poses,
    poses_of,
    shapes_of,
    triangles_of,
    visible_geoms,
)
from selfmodel.robot.robot import Robot
from selfmodel.trials.trajectory import Trajectory, forward_displacement
from selfmodel.trials.trial import Trial

MAX_POSES = 400_000
"""Poses of single bodies in a report, over all motions and frames: 14 bytes each, before base64."""

MAX_FACES = 40_000
"""Triangles of all meshes of a robot, at most."""

MIN_FACES = 200
"""Triangles that each mesh may have, however many meshes there are."""

FINEST_GRID = 64
"""Cells along the longest side of a mesh in the first simplification."""

LEVELS = 65535
"""Largest 16-bit number."""


@dataclass(frozen=True, eq=False)
class Motion:
    """One motion of the robot in a trial; its signals are invalid if the simulation diverged.

    The measured robot has the faults of the best hypothesis.
    """

    name: str
    hypothesis: Hypothesis
    trajectory: Trajectory
    diverged: bool = False

    @property
    def displacement(self) -> float:
        """Forward displacement, m; NaN if the simulation diverged."""
        return np.nan if self.diverged else float(forward_displacement(self.trajectory))

    @property
    def is_drawn(self) -> bool:
        """Whether the motion is finite."""
        return not self.diverged and bool(np.isfinite(self.trajectory["joint_positions"]).all())


@dataclass(frozen=True, eq=False)
class Shot:
    """A trial, its simulations in closed loop, and the time of a change of the robot, s, or None.

    The best hypothesis is first; a healthy trial is simulated by the self-model.
    """

    name: str
    trial: Trial
    rollouts: tuple[Motion, ...]
    mark: float | None = None

    @property
    def motions(self) -> tuple[Motion, ...]:
        """The measured motion, then those that are drawn."""
        measured = Motion("measured", self.rollouts[0].hypothesis, self.trial.trajectory)
        return (measured, *(one for one in self.rollouts if one.is_drawn))


def scene_of(robot: Robot, shots: Sequence[Shot], most_poses: int = MAX_POSES) -> dict[str, Any]:
    """Returns the geometry and the motions of a robot as JSON values.

    Steps are left out where there would be more poses of single bodies, about; the first and the
    last remain.
    """
    bodies = bodies_of(robot.model, robot.root)
    poses = sum(shot.trial.trajectory.steps * len(shot.motions) for shot in shots) * len(bodies)
    stride = max(1, -(-poses // most_poses))
    return {**geometry_of(robot), "shots": [_shot(robot, bodies, one, stride) for one in shots]}


def geometry_of(robot: Robot) -> dict[str, Any]:
    """Returns the bodies, shapes, meshes and hinges of a robot as JSON values.

    Positions are m; quaternions are w x y z. A shape's position and quaternion are in its body's
    frame, its size is that of MuJoCo's geom. ``hinges`` are all hinges by name, ``turned`` those of
    bodies with a single one: the rotation of such a body relative to its parent is ``rest`` at the
    angle ``reference``, and turns about ``axis``.
    """
    model = robot.model
    bodies = bodies_of(model, robot.root)
    index = {int(body): i for i, body in enumerate(bodies)}
    drawn = shapes_of(model, np.flatnonzero(visible_geoms(model)))
    shapes = [shape for shape in drawn if shape.body in index]
    meshes = sorted({shape.mesh for shape in shapes if shape.kind == "mesh"})
    faces = max(MIN_FACES, MAX_FACES // max(1, len(meshes)))
    return {
        "bodies": [str(model.body(body).name) for body in bodies],
        "shapes": [
            {
                "body": index[shape.body],
                "type": shape.kind,
                "size": shape.size.tolist(),
                "position": shape.position.tolist(),
                "quaternion": shape.quaternion.tolist(),
                "mesh": meshes.index(shape.mesh) if shape.kind == "mesh" else -1,
            }
            for shape in shapes
        ],
        "meshes": [
            {"vertices": quantised(vertices), "faces": corners.astype("<u4").tobytes()}
            for vertices, corners in (
                simplified(*triangles_of(model, one), faces) for one in meshes
            )
        ],
        "hinges": list(robot.anatomy.hinges),
        "turned": list(_turned(robot, index)),
        "height": robot.standing_height,
        "root": index[int(model.body(robot.root).id)],
    }


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


def _shot(robot: Robot, bodies: IndexArray, shot: Shot, stride: int) -> dict[str, Any]:
    time = shot.trial.trajectory.time
    steps = np.unique(np.append(np.arange(0, len(time), stride), len(time) - 1))
    return {
        "name": shot.name,
        "time": time[steps].tolist(),
        "mark": shot.mark,
        "motions": [_motion(robot, bodies, motion, steps) for motion in shot.motions],
    }


def _motion(robot: Robot, bodies: IndexArray, motion: Motion, steps: IndexArray) -> dict[str, Any]:
    index = {int(body): i for i, body in enumerate(bodies)}
    # A welded hinge has its own rotation in the hypothesis's model; the geometry is the robot's.
    poses = poses_of(robot, robot.model, motion.trajectory)
    qpos = poses.qpos[steps]
    drawn = body_poses(mujoco.MjData(robot.model), qpos)[:, bodies].reshape(-1, 7)
    hinges = [int(robot.model.joint(name).qposadr[0]) for name in robot.anatomy.hinges]
    model = build(robot, motion.hypothesis).model
    detached = detached_bodies(robot.anatomy, model, motion.hypothesis)
    jammed = jammed_bodies(robot.anatomy, model, motion.hypothesis)
    return {
        "name": motion.name,
        "hypothesis": str(motion.hypothesis),
        "position": quantised(drawn[:, :3]),
        "rotation": quantised(drawn[:, 3:]),
        "angles": quantised(qpos[:, hinges]),
        "missing": list(poses.missing),
        "held": np.flatnonzero(poses.held[steps]).tolist(),
        "detached": sorted(index[body] for body in detached),
        "jammed": sorted(index[body] for body in jammed),
        "travelled": poses.forward[steps].tolist(),
    }


def quantised(values: FloatArray) -> dict[str, Any]:
    """Returns numbers, ``(rows, columns)``, as 16-bit numbers between the bounds of each column.

    They are ``low`` and ``span`` of each column and, in ``data``, little-endian numbers q
    in row-major order: a value is ``low + span * q / 65535``.
    """
    low, high = values.min(axis=0), values.max(axis=0)
    span = high - low
    levels = np.round((values - low) / np.where(span > 0, span, 1.0) * LEVELS)
    return {"low": low.tolist(), "span": span.tolist(), "data": levels.astype("<u2").tobytes()}


def simplified(
    vertices: FloatArray, faces: IndexArray, most_faces: int
) -> tuple[FloatArray, IndexArray]:
    """Returns the vertices and the faces of a mesh with at most that many triangles, 200 or more.

    Vertices in one cell of a grid become one, at their mean; the grid is coarsened until the rest
    is small enough. A mesh that is small enough is returned as it is.

    Source: Rossignac & Borrel, "Multi-resolution 3D approximations for rendering complex scenes"
    (1993).
    """
    mesh, cells = (vertices, faces), FINEST_GRID
    while len(mesh[1]) > most_faces and cells >= 1:
        mesh, cells = _clustered(vertices, faces, cells), cells * 3 // 4
    return mesh


def _clustered(
    vertices: FloatArray, faces: IndexArray, cells: int
) -> tuple[FloatArray, IndexArray]:
    low = vertices.min(axis=0)
    size = float(np.ptp(vertices, axis=0).max()) / cells or 1.0
    keys = np.floor((vertices - low) / size).astype(np.int64)
    _, cluster = np.unique(keys, axis=0, return_inverse=True)
    cluster = cluster.reshape(-1)
    counts = np.bincount(cluster)
    means = [np.bincount(cluster, weights=column) / counts for column in vertices.T]
    corners = cluster[faces]
    ordered = np.sort(corners, axis=1)
    proper = (ordered[:, 0] != ordered[:, 1]) & (ordered[:, 1] != ordered[:, 2])
    _, first = np.unique(ordered[proper], axis=0, return_index=True)
    return np.stack(means, axis=1), corners[proper][np.sort(first)]
