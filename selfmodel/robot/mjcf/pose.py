"""Pose of the robot of an MJCF: its base, its keyframe as the reference pose, the ground below."""

import math
from itertools import product
from xml.etree import ElementTree as ET  # of checked texts

import mujoco
import numpy as np

from selfmodel.errors import InputError, unknown_name
from selfmodel.robot import anatomy_reader as anatomy, contacts
from selfmodel.robot.mjcf.settings import FORWARD_DIRECTIONS, NO_KEYFRAME
from selfmodel.robot.mjcf.work import UniqueNames, Work, format_numbers
from selfmodel.robot.model_variant import turned_by_hinge
from selfmodel.robot.mujoco_errors import loading_a_model

STANDING_KEYFRAMES = ("home", "stand", "standing")
"""Usual names of the keyframe in which a robot stands, in the order in which they are tried."""

STAND_CLEARANCE = 0.02
"""Distance between the ground and the lowest point that a robot on a stand can reach, m."""

_EQUALITY_TOLERANCE = 1e-6
"""Largest violation of an equality constraint in the keyframe, m or rad."""

_LEVEL_TOLERANCE = 1e-9
"""Largest deviation of the ground's unit normal from the vertical, per component."""

_MAX_DISTANCE = 1e6
"""Largest measured distance of a geom from the ground plane, m."""

_OTHER_KEYFRAME = (
    f"start the robot in another keyframe with keyframe=NAME, or in the reference pose with "
    f"keyframe={NO_KEYFRAME}"
)

_COUPLINGS = (int(mujoco.mjtEq.mjEQ_JOINT), int(mujoco.mjtEq.mjEQ_TENDON))
"""Equality constraints with a polynomial of the distances from the reference pose."""


def free_base(work: Work) -> None:
    """Gives the root body of a fixed robot a free joint; a floating base stays as it is."""
    model = work.model
    driven = anatomy.driven_joints(model)
    if not driven or anatomy.floating_bodies(model):
        return
    tops = {int(model.body_rootid[model.jnt_bodyid[joint]]) for joint in driven}
    body = min(tops)
    if len(tops) > 1 or anatomy.joints_of_body(model, body):
        raise InputError(
            "base = 'free' needs one body of the world that carries all driven joints and has no "
            "joint, and the model has none: put the joints into one <body>"
        )
    name = model.body(body).name
    work.named_bodies()[name].insert(0, ET.Element("freejoint", {"name": f"{name}_root"}))
    pose = format_numbers(np.concatenate([model.body_pos[body], model.body_quat[body]]))
    for key in work.children("keyframe"):
        if key.get("qpos"):
            key.set("qpos", f"{pose} {key.get('qpos')}")
    work.notes.append(f"the base {name} has a free joint")


def carry_hinges(work: Work) -> None:
    """Adds the root body of a fixed base if hinges are directly on bodies of the world."""
    model = work.model
    driven = anatomy.driven_joints(model)
    if not driven or anatomy.floating_bodies(model) or anatomy.common_carrier(model):
        return
    tops = {model.body(model.body_rootid[model.jnt_bodyid[joint]]).name for joint in driven}
    name = UniqueNames(element.get("name") for element in work.bodies()).new("base")
    base = ET.Element("body", {"name": name})
    worlds = work.root.findall("worldbody")
    for world in worlds:
        for child in list(world):
            if child.tag == "body" and child.get("name") in tops:
                base.append(child)
                world.remove(child)
    worlds[0].append(base)
    work.notes.append(f"the body {name} is added, which carries {', '.join(sorted(tops))}")


def bake_keyframe(work: Work) -> None:
    """Makes the initial keyframe the reference pose, and removes all keyframes."""
    model = work.model
    number = _keyframe(model, work.settings.keyframe)
    qpos = np.array(model.qpos0 if number is None else model.key_qpos[number])
    if not np.isfinite(qpos).all():
        raise InputError(f"the keyframe has a number that is not finite: {_OTHER_KEYFRAME}")
    if not np.array_equal(qpos, model.qpos0):
        _check_equalities(model, qpos)
        _place_at(work, model, qpos)
        for tendon, element in enumerate(work.children("tendon")):
            if model.tendon_stiffness[tendon]:  # the default depends on the reference pose
                element.set("springlength", format_numbers(model.tendon_lengthspring[tendon]))
        for eq, element in enumerate(work.children("equality")):
            # A linear coupling holds in the new reference pose without an offset.
            if int(model.eq_type[eq]) in _COUPLINGS and model.eq_data[eq, 0]:
                linear = np.array([0.0, model.eq_data[eq, 1], 0.0, 0.0, 0.0])
                element.set("polycoef", format_numbers(linear))
    for part in work.root.findall("keyframe"):
        work.root.remove(part)
    if number is not None:
        name = model.key(number).name or f"number {number}"
        work.notes.append(f"the initial pose is the keyframe {name}")


def _keyframe(model: mujoco.MjModel, wanted: str) -> int | None:
    names = [model.key(k).name for k in range(model.nkey)]
    if wanted == NO_KEYFRAME or not (wanted or names):
        return None
    chosen = wanted or next(filter(names.__contains__, STANDING_KEYFRAMES), names[0])
    if chosen not in names:
        raise unknown_name("keyframe", wanted, [*filter(None, names), NO_KEYFRAME])
    return names.index(chosen)


def _place_at(work: Work, model: mujoco.MjModel, qpos: np.ndarray) -> None:
    """Writes the frames and references for which the reference pose is ``qpos``."""
    positions, orientations = model.body_pos.copy(), model.body_quat.copy()
    references = []
    for joint in range(model.njnt):
        body, address = int(model.jnt_bodyid[joint]), int(model.jnt_qposadr[joint])
        if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE:
            positions[body] = qpos[address : address + 3]
            orientations[body] = qpos[address + 3 : address + 7]
            continue
        shift = float(qpos[address] - model.qpos0[address])
        references.append((joint, float(qpos[address])))
        if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE:
            direction = np.empty(3)
            mujoco.mju_rotVecQuat(direction, model.jnt_axis[joint], orientations[body])
            positions[body] += shift * direction
            continue
        axis, anchor = model.jnt_axis[joint], model.jnt_pos[joint]
        positions[body], orientations[body] = turned_by_hinge(
            positions[body], orientations[body], axis, anchor, shift
        )
    work.place_bodies(positions, orientations, references)


def _check_equalities(model: mujoco.MjModel, qpos: np.ndarray) -> None:
    with loading_a_model():
        data = mujoco.MjData(model)
        data.qpos = qpos
        mujoco.mj_fwdPosition(model, data)
    rows = data.efc_type[: data.nefc] == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    violated = np.abs(data.efc_pos[: data.nefc][rows]) > _EQUALITY_TOLERANCE
    nonlinear = np.isin(model.eq_type, _COUPLINGS) & model.eq_data[:, 2:5].any(axis=1)
    if nonlinear.any() or violated.any():
        raise InputError(
            f"equality constraints are violated in the keyframe, or are nonlinear: "
            f"{_OTHER_KEYFRAME}"
        )


def turn_forward(work: Work) -> None:
    """Rotates a floating robot until its forward direction is the world's x axis."""
    forward = work.settings.forward
    angle = -math.radians(FORWARD_DIRECTIONS[forward])
    if not angle:
        return
    model = work.model
    free = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
    if not len(free):
        raise InputError(
            f"forward={forward} needs a root body with a free joint, got none: rotate the "
            f"robot in its file, so that x is forward"
        )
    if np.any(model.opt.gravity[:2]) or np.any(model.opt.wind[:2]) or not _is_flat(model):
        raise InputError(
            f"forward={forward} rotates the robot, and its world is not the same from all "
            f"sides: rotate the robot in its file, so that x is forward"
        )
    body = int(model.jnt_bodyid[free[0]])
    orientations, turned = model.body_quat.copy(), np.empty(4)
    turn = np.array([math.cos(angle / 2), 0, 0, math.sin(angle / 2)])
    mujoco.mju_mulQuat(turned, turn, orientations[body])
    orientations[body] = turned
    work.place_bodies(model.body_pos, orientations)
    work.notes.append(f"the initial pose is rotated, so that {forward} is forward")


def _is_flat(model: mujoco.MjModel) -> bool:
    """Returns whether all static geoms that can be touched are level planes."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    ground = contacts.static_geoms(model) & contacts.touching_geoms(model)
    planes = model.geom_type[ground] == mujoco.mjtGeom.mjGEOM_PLANE
    normals = data.geom_xmat[ground][:, 2::3]
    return bool(planes.all() and np.allclose(normals, (0, 0, 1), rtol=0, atol=_LEVEL_TOLERANCE))


def fix_base(work: Work) -> None:
    """Fixes a floating base to the world, above the ground; a fixed base stays as it is.

    Its height is that of the settings, or else that in the initial pose, or the lowest height at
    which the robot cannot touch the ground if that is larger.
    """
    model, height = work.model, work.settings.base_height
    floating = anatomy.floating_bodies(model)
    root = floating[0] if floating else anatomy.common_carrier(model)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    wanted = float(data.xpos[root, 2]) if height is None else height
    if floating and height is None:
        wanted = max(wanted, _ground_height(model, data) + STAND_CLEARANCE + _reach(model, root))
    positions = model.body_pos.copy()
    positions[model.body_rootid[root], 2] += wanted - data.xpos[root, 2]
    work.place_bodies(positions, model.body_quat)
    name = model.body(root).name
    element = work.named_bodies()[name]
    if floating:
        for joint in [child for child in element if child.tag in ("joint", "freejoint")]:
            element.remove(joint)
        _keep_neighbours_apart(work, model, root)
    work.notes.append(f"the base {name} is fixed at a height of {wanted:.3g} m")


def _keep_neighbours_apart(work: Work, model: mujoco.MjModel, root: int) -> None:
    """Excludes the contacts between a base and the bodies that joints connect to it.

    MuJoCo ignores the contacts of a body with its parent only if the parent can move.
    """
    if model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FILTERPARENT:
        return
    weld = model.body_weldid
    base = weld[root]
    neighbours = (weld != base) & (weld[model.body_parentid[weld]] == base)
    shaped = model.body_geomnum > 0
    contact = work.section("contact")
    pairs = product(np.flatnonzero(shaped & (weld == base)), np.flatnonzero(shaped & neighbours))
    for fixed, other in pairs:
        pair = {"body1": model.body(int(fixed)).name, "body2": model.body(int(other)).name}
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
    ground = contacts.static_geoms(model) & contacts.touching_geoms(model)
    return float(np.where(planes, heights, tops)[ground].max(initial=-np.inf))


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
            anchors = model.jnt_pos[anatomy.joints_of_body(model, body)]
            distance[body] = (
                distance[model.body_parentid[body]]
                + np.linalg.norm(model.body_pos[body])
                + 2 * np.linalg.norm(anchors, axis=1).sum()
            )
        geoms = model.geom_bodyid == body
        outward = np.linalg.norm(model.geom_pos[geoms], axis=1) + model.geom_rbound[geoms]
        reach = max(reach, float(distance[body] + outward.max(initial=0.0)))
    return reach


def add_ground(work: Work) -> None:
    """Adds a plane under the lowest point of a robot that could touch no static geom.

    Models without contacts, models of swimmers and robots with a fixed base get no ground.
    """
    model = work.model
    swims = model.opt.density or model.opt.viscosity
    if swims or not contacts.contacts_enabled(model) or contacts.ground_contact_geoms(model):
        return
    if not anatomy.floating_bodies(model):
        return
    moving = ~contacts.static_geoms(model)
    contype, conaffinity = (
        int(np.bitwise_or.reduce(mask[moving], initial=0))
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
    work.section("worldbody").insert(0, element)
    data = mujoco.MjData(work.model)
    mujoco.mj_kinematics(work.model, data)
    height = lowest_point(work.model, data)
    element.set("pos", format_numbers(np.array([0.0, 0.0, height])))
    work.notes.append(f"a ground plane is added at a height of {height:.3g} m")


def lowest_point(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Returns the height of the lowest moving geom above geom 0, a plane at height 0, in m."""
    return min(
        float(mujoco.mj_geomDistance(model, data, 0, geom, _MAX_DISTANCE, None))
        for geom in contacts.ground_contact_geoms(model)
    )
