"""The robot in its world: fixes or frees the base of an MJCF, and adds a ground."""

from xml.etree import ElementTree as ET  # of checked texts

import mujoco
import numpy as np

from selfmodel.errors import InputError
from selfmodel.robot.anatomy_reader import (
    common_carrier,
    driven_joints,
    floating_bodies,
    joints_of_body,
)
from selfmodel.robot.contacts import (
    contacts_enabled,
    ground_contact_geoms,
    static_geoms,
    touching_geoms,
)
from selfmodel.robot.mjcf.document import BodyFrames, Document, format_numbers
from selfmodel.robot.mjcf.names import UniqueNames

STAND_CLEARANCE = 0.02
"""Distance between the ground and the lowest point that a robot on a stand can reach, m."""

_JOINTS = ("joint", "freejoint")


def free_base(document: Document) -> None:
    """Gives the root body of a fixed robot a free joint; a floating base stays as it is.

    Args:
        document: The MJCF, edited in place.

    Raises:
        InputError: No body of the world carries all driven joints, or that body has a joint.
    """
    model = document.model
    driven = driven_joints(model)
    if not driven or floating_bodies(model, driven):
        return
    tops = {int(model.body_rootid[model.jnt_bodyid[joint]]) for joint in driven}
    body = min(tops)
    if len(tops) > 1 or joints_of_body(model, body):
        raise InputError(
            "base = 'free' needs one body of the world that carries all driven joints and has no "
            "joint, and the model has none: put the joints into one <body>"
        )
    name = model.body(body).name
    document.named_bodies()[name].insert(0, ET.Element("freejoint", {"name": f"{name}_root"}))
    pose = format_numbers(np.concatenate([model.body_pos[body], model.body_quat[body]]))
    for key in document.children("keyframe"):
        if key.get("qpos"):
            key.set("qpos", f"{pose} {key.get('qpos')}")
    document.notes.append(f"the base {name} has a free joint")


def carry_hinges(document: Document) -> None:
    """Adds the root body of a fixed base if hinges are directly on bodies of the world.

    Args:
        document: The MJCF, edited in place.
    """
    model = document.model
    driven = driven_joints(model)
    if not driven or floating_bodies(model, driven) or common_carrier(model, driven):
        return
    tops = {model.body(model.body_rootid[model.jnt_bodyid[joint]]).name for joint in driven}
    name = UniqueNames(element.get("name") for element in document.bodies()).new("base")
    base = ET.Element("body", {"name": name})
    worlds = document.root.findall("worldbody")
    for world in worlds:
        base.extend(child for child in world if child.tag == "body" and child.get("name") in tops)
    for world in worlds:
        for child in [child for child in world if child in list(base)]:
            world.remove(child)
    worlds[0].append(base)
    document.notes.append(f"the body {name} is added, which carries {', '.join(sorted(tops))}")


def fix_base(document: Document, height: float | None) -> None:
    """Fixes a floating base to the world, above the ground; a fixed base stays as it is.

    Args:
        document: The MJCF, edited in place.
        height: Height of the root body, m; None for the height in the initial pose, or the lowest
            height at which the robot cannot touch the ground if that is larger.
    """
    model = document.model
    driven = driven_joints(model)
    floating = floating_bodies(model, driven)
    root = floating[0] if floating else common_carrier(model, driven)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    wanted = float(data.xpos[root, 2]) if height is None else height
    if floating and height is None:
        wanted = max(wanted, _ground_height(model, data) + STAND_CLEARANCE + _reach(model, root))
    frames = BodyFrames.of(model)
    frames.position[model.body_rootid[root], 2] += wanted - data.xpos[root, 2]
    frames.write(document, model)
    name = model.body(root).name
    element = document.named_bodies()[name]
    if floating:
        for joint in [child for child in element if child.tag in _JOINTS]:
            element.remove(joint)
        _keep_neighbours_apart(document, model, root)
    document.notes.append(f"the base {name} is fixed at a height of {wanted:.3g} m")


def _keep_neighbours_apart(document: Document, model: mujoco.MjModel, root: int) -> None:
    """Excludes the contacts between a base and the bodies that joints connect to it.

    MuJoCo ignores the contacts of a body with its parent only if the parent can move.
    """
    if model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FILTERPARENT:
        return
    weld = model.body_weldid
    base = weld[root]
    neighbours = (weld != base) & (weld[model.body_parentid[weld]] == base)
    touched = model.body_geomnum > 0
    contact = document.section("contact")
    for own in np.flatnonzero(touched & (weld == base)):
        for other in np.flatnonzero(touched & neighbours):
            pair = {"body1": model.body(int(own)).name, "body2": model.body(int(other)).name}
            if not any(pair.items() <= known.attrib.items() for known in contact):
                ET.SubElement(contact, "exclude", pair)


def _ground_height(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Returns the height of the highest static geom that can be touched, m; minus infinity without.

    A plane has the height of its centre.
    """
    heights = data.geom_xpos[:, 2].copy()
    vertical = data.geom_xmat[:, 6:]
    centre, half = model.geom_aabb[:, :3], model.geom_aabb[:, 3:]
    tops = heights + (vertical * centre).sum(axis=1) + (np.abs(vertical) * half).sum(axis=1)
    planes = model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
    return float(
        np.where(planes, heights, tops)[static_geoms(model) & touching_geoms(model)].max(
            initial=-np.inf
        )
    )


def _reach(model: mujoco.MjModel, root: int) -> float:
    """Returns an upper bound of the distance of any point of a robot from its root body, m.

    The bound holds at all joint angles: no hinge moves a point away from its own axis.
    """
    distance = np.zeros(model.nbody)
    reach = 0.0
    for body in range(root, model.nbody):
        if model.body_rootid[body] != model.body_rootid[root]:
            continue
        if body != root:
            anchors = model.jnt_pos[joints_of_body(model, body)]
            distance[body] = (
                distance[model.body_parentid[body]]
                + np.linalg.norm(model.body_pos[body])
                + 2 * np.linalg.norm(anchors, axis=1).sum()
            )
        own = model.geom_bodyid == body
        outward = np.linalg.norm(model.geom_pos[own], axis=1) + model.geom_rbound[own]
        reach = max(reach, float(distance[body] + outward.max(initial=0.0)))
    return reach


_MAX_DISTANCE = 1e6
"""Largest measured distance of a geom from the ground plane, m."""


def add_ground(document: Document) -> None:
    """Adds a plane under the lowest point of a robot that could touch no static geom.

    Models without contacts, models of swimmers and robots with a fixed base get no ground.

    Args:
        document: The MJCF, edited in place.

    Raises:
        InputError: No geom of the robot could touch a ground.
    """
    model = document.model
    if not contacts_enabled(model) or ground_contact_geoms(model) or _swims(model):
        return
    if not floating_bodies(model, driven_joints(model)):
        return
    contype, conaffinity = (
        int(np.bitwise_or.reduce(mask[~static_geoms(model)], initial=0))
        for mask in (model.geom_contype, model.geom_conaffinity)
    )
    if not contype | conaffinity:
        raise InputError(
            "no geom of the robot can touch anything: give the geoms of its limbs a contype of 1, "
            "or <option> a density or viscosity if the robot swims or flies"
        )
    plane = {
        "name": UniqueNames(model.geom(g).name for g in range(model.ngeom)).new("ground"),
        "type": "plane",
        "size": "0 0 1",
        "contype": str(conaffinity or 1),
        "conaffinity": str(contype),
        "condim": "3",
        "friction": "1 0.005 0.0001",
        "pos": "0 0 0",
        "quat": "1 0 0 0",
    }
    element = ET.Element("geom", plane)
    document.section("worldbody").insert(0, element)
    grounded = document.model
    data = mujoco.MjData(grounded)
    mujoco.mj_kinematics(grounded, data)
    height = lowest_point(grounded, data)
    element.set("pos", format_numbers(np.array([0.0, 0.0, height])))
    document.notes.append(f"a ground plane is added at a height of {height:.3g} m")


def _swims(model: mujoco.MjModel) -> bool:
    return bool(model.opt.density or model.opt.viscosity)


def lowest_point(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Returns the height of the lowest moving geom above geom 0, a plane at height 0, in m.

    Args:
        model: A model with geoms that can touch the plane.
        data: Positions of the geoms.
    """
    distances = (
        mujoco.mj_geomDistance(model, data, 0, geom, _MAX_DISTANCE, None)
        for geom in ground_contact_geoms(model)
    )
    return float(min(distances))
