"""Self-collision of a robot: how deep its bodies penetrate each other, from its joint positions."""

import copy
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import mujoco
import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray
from selfmodel.robot.contacts import touching_geoms
from selfmodel.robot.robot import Robot

CONTACT_MEMORY = 4 * 2**20
"""Size of MuJoCo's arena for the contacts of one pose, bytes."""


def penetration_depths(
    robot: Robot, positions: FloatArray, lost: Collection[int] = ()
) -> FloatArray:
    """Returns the largest depth to which two bodies of a robot penetrate each other, per pose.

    All bodies are compared, whether or not contacts of the two are simulated, but for two that are
    rigidly connected, that are neighbours in the kinematic tree, or that penetrate each other in
    the initial pose, as parts of an assembly do. These are the pairs "adjacent" and "default" that
    MoveIt's Setup Assistant leaves out. The shape of a body is made of its geoms that can touch
    anything, or of all its geoms if there are none.

    Args:
        robot: The robot.
        positions: Angles of its hinges, rad, ``(poses, hinges)``.
        lost: Ids of bodies that are not compared.

    Returns:
        Depths, m, ``(poses,)``; 0 without a penetration.
    """
    shape = _collision_shape(robot)
    model = shape.without(lost)
    data = mujoco.MjData(model)
    poses = np.tile(model.qpos0, (len(positions), 1))
    poses[:, shape.columns] = positions
    # A run that has ended keeps its pose.
    new = np.ones(len(poses), dtype=bool)
    new[1:] = (poses[1:] != poses[:-1]).any(axis=1)
    distinct, qpos = poses[new], data.qpos
    depths = np.zeros(len(distinct))
    for number, pose in enumerate(distinct):
        qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        if data.ncon:
            depths[number] = -data.contact.dist.min()
    return np.asarray(np.maximum(depths, 0.0)[np.cumsum(new) - 1])


@dataclass(frozen=True, eq=False)
class CollisionShape:
    """Model of a robot in which the bodies to compare collide, and nothing else does.

    Attributes:
        model: The model, of the robot's layout.
        columns: Index of each hinge in ``qpos``, ``(hinges,)``.
    """

    model: mujoco.MjModel
    columns: IndexArray

    def without(self, lost: Collection[int]) -> mujoco.MjModel:
        """Returns the model in which some bodies, given by id, do not collide."""
        if not lost:
            return self.model
        model = copy.copy(self.model)
        geoms = np.isin(model.geom_bodyid, list(lost))
        model.geom_contype[geoms] = model.geom_conaffinity[geoms] = 0
        return model


@lru_cache(maxsize=8)
def _collision_shape(robot: Robot) -> CollisionShape:
    """Returns the model for the collisions of a robot; the last ones are kept."""
    solid = _solid_geoms(robot)
    spec = robot.specification()
    for parts in (spec.excludes, spec.pairs):
        for part in list(parts):
            spec.delete(part)
    spec.compile()  # which numbers the parts
    for body in spec.bodies[1:]:
        body.name = body.name or f"unnamed body {body.id}"
    for geom in spec.geoms:
        geom.contype = geom.conaffinity = int(solid[geom.id])
        geom.margin = geom.gap = 0.0
    names = {body.id: body.name for body in spec.bodies}
    spec.memory = max(spec.memory, CONTACT_MEMORY)
    disabled = mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    spec.option.disableflags &= ~int(disabled)
    for first, second in _adjacent(robot.model, solid):
        spec.add_exclude(bodyname1=names[first], bodyname2=names[second])
    for first, second in _penetrating(spec.compile()):
        spec.add_exclude(bodyname1=names[first], bodyname2=names[second])
    model = spec.compile()
    columns = [int(model.joint(name).qposadr[0]) for name in robot.anatomy.hinges]
    return CollisionShape(model, np.array(columns, dtype=np.intp))


def _solid_geoms(robot: Robot) -> BoolArray:
    """Returns whether each geom is of the shape of the robot, ``(ngeom,)``."""
    model = robot.model
    root = int(model.body(robot.root).id)
    own = [body for body in range(model.nbody) if root in (body, *_ancestors(model, body))]
    touches = touching_geoms(model)
    touching = np.isin(model.geom_bodyid, model.geom_bodyid[touches])
    return np.asarray(np.isin(model.geom_bodyid, own) & (touches | ~touching))


def _adjacent(model: mujoco.MjModel, solid: BoolArray) -> Iterator[tuple[int, int]]:
    """Yields the bodies that are rigidly connected or neighbours; bodies without a shape are none.

    Args:
        model: Model of the robot.
        solid: Whether each geom is of the shape of the robot, ``(ngeom,)``.
    """
    bodies = sorted(set(model.geom_bodyid[solid].tolist()))
    group = {body: int(model.body_weldid[body]) for body in range(model.nbody)}
    shaped = {group[body] for body in bodies}
    above = {
        body: next(
            (
                group[one]
                for one in _ancestors(model, body)
                if group[one] in shaped and group[one] != group[body]
            ),
            None,
        )
        for body in bodies
    }
    for one, other in combinations(bodies, 2):
        if group[one] in (group[other], above[other]) or group[other] == above[one]:
            yield one, other


def _ancestors(model: mujoco.MjModel, body: int) -> Iterator[int]:
    """Yields the bodies that a body is attached to, the nearest first, without the world."""
    while body := int(model.body_parentid[body]):
        yield body


def _penetrating(model: mujoco.MjModel) -> Iterator[tuple[int, int]]:
    """Yields the bodies of a model that penetrate each other in the initial pose."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_collision(model, data)
    geoms = data.contact.geom[data.contact.dist < 0]
    for first, second in np.unique(np.sort(model.geom_bodyid[geoms], axis=1), axis=0):
        yield int(first), int(second)
