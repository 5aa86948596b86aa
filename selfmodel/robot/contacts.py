"""Contacts by geometry: which geoms can touch, which limbs reach the ground, self-collision."""

import copy
from collections.abc import Collection, Iterator, Sequence
from functools import lru_cache
from itertools import combinations

import mujoco
import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray
from selfmodel.robot.actuators import ancestors
from selfmodel.robot.anatomy import Joint
from selfmodel.robot.robot import Robot

REACH_TOLERANCE = 0.05
"""Largest distance of a lowered leg from the ground, relative to the height of the root body. The
forelegs of dm_control's dog touch the ground, and its tail ends at 0.13."""

_ANGLES = 13
"""Number of angles per hinge that are tried."""

_SWEEPS = 2
"""Largest number of changes of each hinge."""

CONTACT_MEMORY = 4 * 2**20
"""Size of MuJoCo's arena for the contacts of one pose, bytes."""


def contacts_enabled(model: mujoco.MjModel) -> bool:
    """Returns whether contacts are simulated; a swimmer may disable them."""
    disable = mujoco.mjtDisableBit
    return not model.opt.disableflags & (disable.mjDSBL_CONTACT | disable.mjDSBL_CONSTRAINT)


def touching_geoms(model: mujoco.MjModel) -> BoolArray:
    """Returns whether each geom can touch anything, by a mask or a ``<pair>``, ``(ngeom,)``."""
    touching = (model.geom_contype | model.geom_conaffinity) != 0
    touching[model.pair_geom1] = touching[model.pair_geom2] = True
    return np.asarray(touching)


def can_touch(model: mujoco.MjModel, geoms: BoolArray | IndexArray) -> BoolArray:
    """Returns whether the mask of each geom lets it touch one of some geoms, ``(ngeom,)``."""
    contype, conaffinity = (
        np.bitwise_or.reduce(mask[geoms], initial=0)
        for mask in (model.geom_contype, model.geom_conaffinity)
    )
    touching = (model.geom_contype & conaffinity) | (model.geom_conaffinity & contype)
    return np.asarray(touching != 0)


def static_geoms(model: mujoco.MjModel) -> BoolArray:
    """Returns whether each geom belongs to the world or is fixed to it, ``(ngeom,)``."""
    return np.asarray(model.body_weldid[model.geom_bodyid] == 0)


def ground_contact_geoms(model: mujoco.MjModel) -> list[int]:
    """Returns the ids of the moving geoms that can touch a static geom."""
    static = static_geoms(model)
    touching = can_touch(model, static)
    touching[model.pair_geom1[static[model.pair_geom2]]] = True
    touching[model.pair_geom2[static[model.pair_geom1]]] = True
    ids: list[int] = np.flatnonzero(touching & ~static).tolist()
    return ids


def reaches_ground(robot: Robot, limb: Sequence[Joint]) -> bool:
    """Returns whether a limb can be lowered to the ground while the robot stands.

    The ground is at the height of the robot's lowest point in the initial pose. The limb is lowered
    by its own joints, one hinge after the other over its range; the rest of the robot keeps the
    initial pose. Only geoms that can touch the ground count. The joint of the limb that is nearest
    to the root body is the first.
    """
    model = robot.model
    geoms = np.array(ground_contact_geoms(model), dtype=np.intp)
    bodies = [model.body(name).id for name in limb[0].bodies]
    of_limb = geoms[np.isin(model.geom_bodyid[geoms], bodies)]
    if not len(of_limb) or not contacts_enabled(model):
        return False
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    lowest = _lowest_point(model, data, geoms)
    root_height = float(data.xpos[model.body(robot.root).id, 2]) - lowest
    ground = lowest + REACH_TOLERANCE * max(0.0, root_height)
    hinges = [model.joint(hinge).qposadr[0] for joint in limb for hinge in joint.hinges]
    limits = [ends for joint in limb for ends in joint.limits]
    for address, ends in list(zip(hinges, limits, strict=True)) * _SWEEPS:
        if _lowest_point(model, data, of_limb) <= ground:
            return True
        angles = np.array([data.qpos[address], *np.linspace(*ends, _ANGLES)])
        heights = []
        for angle in angles:
            data.qpos[address] = angle
            mujoco.mj_kinematics(model, data)
            heights.append(_lowest_point(model, data, of_limb))
        data.qpos[address] = angles[np.argmin(heights)]
        mujoco.mj_kinematics(model, data)
    return _lowest_point(model, data, of_limb) <= ground


def _lowest_point(model: mujoco.MjModel, data: mujoco.MjData, geoms: IndexArray) -> float:
    """Returns the height of the lowest point of some geoms, m; for meshes, of their boxes."""
    down = -data.geom_xmat[geoms, 6:9]  # the vertical in the frame of each geom
    box, size, kind = model.geom_aabb[geoms], model.geom_size[geoms], model.geom_type[geoms]
    boxes = (down * box[:, :3]).sum(axis=1) + (np.abs(down) * box[:, 3:]).sum(axis=1)
    along = size[:, 1] * np.abs(down[:, 2])
    extents = {
        mujoco.mjtGeom.mjGEOM_SPHERE: size[:, 0],
        mujoco.mjtGeom.mjGEOM_CAPSULE: size[:, 0] + along,
        mujoco.mjtGeom.mjGEOM_CYLINDER: size[:, 0] * np.hypot(down[:, 0], down[:, 1]) + along,
        mujoco.mjtGeom.mjGEOM_ELLIPSOID: np.sqrt(np.square(size * down).sum(axis=1)),
    }
    chosen = np.select([kind == int(k) for k in extents], list(extents.values()), boxes)
    return float(np.min(data.geom_xpos[geoms, 2] - chosen))


def penetration_depths(
    robot: Robot, positions: FloatArray, lost: Collection[int] = ()
) -> FloatArray:
    """Returns the largest depth to which two bodies of a robot penetrate each other, per pose, m.

    All bodies are compared, whether or not contacts of the two are simulated, but for two that are
    rigidly connected, that are neighbours in the kinematic tree, or that penetrate each other in
    the initial pose, as parts of an assembly do. These are the pairs "adjacent" and "default" that
    MoveIt's Setup Assistant leaves out. The shape of a body is made of its geoms that can touch
    anything, or of all its geoms if there are none. The positions are angles of the hinges, rad,
    ``(poses, hinges)``; ``lost`` has the ids of bodies that are not compared.
    """
    model = _collision_model(robot)
    if lost:
        model = copy.copy(model)
        geoms = np.isin(model.geom_bodyid, list(lost))
        model.geom_contype[geoms] = model.geom_conaffinity[geoms] = 0
    data = mujoco.MjData(model)
    poses = np.tile(model.qpos0, (len(positions), 1))
    poses[:, [int(model.joint(name).qposadr[0]) for name in robot.anatomy.hinges]] = positions
    # A run that has ended keeps its pose.
    new = np.ones(len(poses), dtype=bool)
    new[1:] = (poses[1:] != poses[:-1]).any(axis=1)
    depths = np.zeros(np.count_nonzero(new))
    for number, pose in enumerate(poses[new]):
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        if data.ncon:
            depths[number] = -data.contact.dist.min()
    return np.asarray(np.maximum(depths, 0.0)[np.cumsum(new) - 1])


@lru_cache(maxsize=8)
def _collision_model(robot: Robot) -> mujoco.MjModel:
    """Returns the model of a robot in which the bodies to compare collide, and nothing else does.

    The models of the last robots are kept.
    """
    solid = _solid_geoms(robot)
    spec = robot.specification()
    for part in [*spec.excludes, *spec.pairs]:
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
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_collision(model, data)
    geoms = data.contact.geom[data.contact.dist < 0]
    for first, second in np.unique(np.sort(model.geom_bodyid[geoms], axis=1), axis=0):
        spec.add_exclude(bodyname1=names[int(first)], bodyname2=names[int(second)])
    return spec.compile()


def _solid_geoms(robot: Robot) -> BoolArray:
    model = robot.model
    root = int(model.body(robot.root).id)
    bodies = [body for body in range(model.nbody) if root in ancestors(model, body)]
    touches = touching_geoms(model)
    touching = np.isin(model.geom_bodyid, model.geom_bodyid[touches])
    return np.asarray(np.isin(model.geom_bodyid, bodies) & (touches | ~touching))


def _adjacent(model: mujoco.MjModel, solid: BoolArray) -> Iterator[tuple[int, int]]:
    """Yields the bodies with a shape that are rigidly connected or neighbours."""
    bodies = sorted(set(model.geom_bodyid[solid].tolist()))
    group: list[int] = model.body_weldid.tolist()
    shaped = {group[body] for body in bodies}
    above = {}
    for body in bodies:
        groups = (group[ancestor] for ancestor in ancestors(model, body)[1:])
        above[body] = next((g for g in groups if g in shaped and g != group[body]), None)
    for one, other in combinations(bodies, 2):
        if group[one] in (group[other], above[other]) or group[other] == above[one]:
            yield one, other
