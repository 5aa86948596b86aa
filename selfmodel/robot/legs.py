"""Reach of limbs: a leg can be lowered to the ground, and an arm, a neck or an antenna cannot."""

from collections.abc import Sequence

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.robot.anatomy import Joint
from selfmodel.robot.contacts import contacts_enabled, ground_contact_geoms
from selfmodel.robot.robot import Robot

TOLERANCE = 0.05
"""Largest distance of a lowered leg from the ground, relative to the height of the root body. The
forelegs of dm_control's dog touch the ground, and its tail ends at 0.13."""

_ANGLES = 13
"""Number of angles per hinge that are tried."""

_SWEEPS = 2
"""Largest number of changes of each hinge."""


def reaches_ground(robot: Robot, limb: Sequence[Joint]) -> bool:
    """Returns whether a limb can be lowered to the ground while the robot stands.

    The ground is at the height of the robot's lowest point in the initial pose. The limb is lowered
    by its own joints, one hinge after the other over its range; the rest of the robot keeps the
    initial pose. Only geoms that can touch the ground count.

    Args:
        robot: The robot.
        limb: Joints of the limb, the one nearest to the root body first.
    """
    model = robot.model
    geoms = np.array(ground_contact_geoms(model), dtype=np.intp)
    bodies = [model.body(name).id for name in limb[0].bodies]
    own = geoms[np.isin(model.geom_bodyid[geoms], bodies)]
    if not len(own) or not contacts_enabled(model):
        return False
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    lowest = _lowest_point(model, data, geoms)
    root_height = float(data.xpos[model.body(robot.root).id, 2]) - lowest
    ground = lowest + TOLERANCE * max(0.0, root_height)
    hinges = [model.joint(hinge).qposadr[0] for joint in limb for hinge in joint.hinges]
    limits = [ends for joint in limb for ends in joint.limits]
    for address, ends in list(zip(hinges, limits, strict=True)) * _SWEEPS:
        if _lowest_point(model, data, own) <= ground:
            return True
        _lower(model, data, own, address, ends)
    return _lowest_point(model, data, own) <= ground


def _lower(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    geoms: IndexArray,
    address: int,
    limits: tuple[float, float],
) -> None:
    """Moves a hinge to the angle at which some geoms are lowest, if it is lower than the current.

    Args:
        model: Model of the robot.
        data: State of the robot; its position is changed.
        geoms: Ids of the geoms.
        address: Index of the hinge in ``qpos``.
        limits: Lower and upper angle of the hinge, rad.
    """
    angles = np.array([data.qpos[address], *np.linspace(*limits, _ANGLES)])
    heights = []
    for angle in angles:
        data.qpos[address] = angle
        mujoco.mj_kinematics(model, data)
        heights.append(_lowest_point(model, data, geoms))
    data.qpos[address] = angles[np.argmin(heights)]
    mujoco.mj_kinematics(model, data)


def _lowest_point(model: mujoco.MjModel, data: mujoco.MjData, geoms: IndexArray) -> float:
    """Returns the height of the lowest point of some geoms, m; for meshes, of their boxes."""
    down = -data.geom_xmat[geoms, 6:9]  # the vertical in the frame of each geom
    box = model.geom_aabb[geoms]
    extents = (down * box[:, :3]).sum(axis=1) + (np.abs(down) * box[:, 3:]).sum(axis=1)
    kinds, sizes = model.geom_type[geoms], model.geom_size[geoms]
    for kind, extent in _EXTENTS.items():
        round_ = kinds == kind
        extents[round_] = extent(sizes[round_], down[round_])
    return float(np.min(data.geom_xpos[geoms, 2] - extents))


def _sphere(size: FloatArray, _down: FloatArray) -> FloatArray:
    return size[:, 0]


def _capsule(size: FloatArray, down: FloatArray) -> FloatArray:
    return np.asarray(size[:, 0] + size[:, 1] * np.abs(down[:, 2]))


def _cylinder(size: FloatArray, down: FloatArray) -> FloatArray:
    across = np.hypot(down[:, 0], down[:, 1])
    return np.asarray(size[:, 0] * across + size[:, 1] * np.abs(down[:, 2]))


def _ellipsoid(size: FloatArray, down: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.square(size * down).sum(axis=1)))


_EXTENTS = {
    int(mujoco.mjtGeom.mjGEOM_SPHERE): _sphere,
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): _capsule,
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): _cylinder,
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): _ellipsoid,
}
"""Distance from the centre of a geom to its lowest point, m, by the type of the geom. The extent of
a box, and of the bounding box of a mesh, is that of ``geom_aabb``."""
