"""Converts a URDF to MJCF: MuJoCo's importer reads the bodies; motors and a stance are added."""

import math
from dataclasses import dataclass
from xml.etree import ElementTree as ET  # of checked texts

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.errors import InputError, listed
from selfmodel.robot.contacts import ground_contact_geoms
from selfmodel.robot.mjcf.document import Document, format_numbers
from selfmodel.robot.mjcf.settings import JointValues, MjcfSettings, check_patterns, value_of
from selfmodel.robot.mjcf.world import lowest_point
from selfmodel.robot.mujoco_errors import compile_model, loading_a_model
from selfmodel.robot.urdf import HINGE_TYPES, number, quoted
from selfmodel.robot.urdf_bodies import is_rigid, meshes, world_elements

FULL_EFFORT_ERROR = 0.5
"""Position error at which a servo without the setting ``kp`` exerts its full effort, rad; half of
the joint's range, if that is less."""

DAMPING_TIMES = (0.02, 0.1)
"""Least and greatest kd / kp of a servo without the setting ``kd``, s. In between, the damping
equals the effort at the velocity limit."""

UNLIMITED_RANGE = (-math.pi, math.pi)
"""Command range of a continuous joint, rad."""


def servo(joint: ET.Element, settings: MjcfSettings) -> tuple[ET.Element, str]:
    """Returns the position servo of a joint as MJCF, and a note.

    Args:
        joint: The ``<joint>`` of the URDF, a hinge.
        settings: Settings with kp, kd and effort.

    Raises:
        InputError: The joint has no effort limit, and the settings contain none.
    """
    name = joint.get("name", "")
    limit = joint.find("limit")
    limit = ET.Element("limit") if limit is None else limit
    effort = value_of(settings.effort, name)
    if effort is None:
        effort = number(limit, "effort", 0.0)
    if effort <= 0:
        raise InputError(
            f"the joint {quoted(name)} has no effort limit above 0: add it to its <limit>, or "
            f"set the torque of such joints, in N m, with effort = ..."
        )
    low, high = UNLIMITED_RANGE
    if joint.get("type") == "revolute":
        low, high = number(limit, "lower", 0.0), number(limit, "upper", 0.0)
    kp = value_of(settings.kp, name)
    if kp is None:
        kp = effort / min(FULL_EFFORT_ERROR, (high - low) / 2)
    kd = value_of(settings.kd, name)
    if kd is None:
        velocity = number(limit, "velocity", 0.0)
        least, most = (kp * time for time in DAMPING_TIMES)
        kd = most if velocity <= 0 else min(max(effort / velocity, least), most)
    attributes = {
        "name": name,
        "joint": name,
        "kp": repr(kp),
        "kv": repr(kd),
        "ctrlrange": f"{low!r} {high!r}",
        "ctrllimited": "true",
        "forcerange": f"{-effort!r} {effort!r}",
        "forcelimited": "true",
    }
    return ET.Element("position", attributes), f"kp {kp:.3g}, kd {kd:.3g}, {effort:.3g} N m"


@dataclass(frozen=True)
class Stance:
    """An initial pose.

    Attributes:
        qpos: ``(nq,)``, with the lowest colliding geom at height 0 if the base is free.
        overlapping: Names of the pairs of bodies that overlap in the pose.
    """

    qpos: FloatArray
    overlapping: list[tuple[str, str]]


def stance(model: mujoco.MjModel, pose: JointValues) -> Stance:
    """Returns the initial pose of a robot.

    Args:
        model: The model; if its base is free, geom 0 is a horizontal plane at height 0.
        pose: Angles of joints by name or pattern, rad; of the others, the angle of the range that
            is nearest to 0.

    Raises:
        InputError: An angle is outside the range of its joint.
    """
    data = mujoco.MjData(model)
    for j in range(model.njnt):
        if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_HINGE:
            data.qpos[model.jnt_qposadr[j]] = _angle(model, j, pose)
    _follow_couplings(model, data.qpos)
    mujoco.mj_kinematics(model, data)
    free = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
    if len(free) and ground_contact_geoms(model):
        data.qpos[model.jnt_qposadr[free[0]] + 2] -= lowest_point(model, data)
        mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_collision(model, data)
    return Stance(data.qpos.copy(), _overlapping(model, data))


def _angle(model: mujoco.MjModel, joint: int, pose: JointValues) -> float:
    name = model.joint(joint).name
    low, high = model.jnt_range[joint] if model.jnt_limited[joint] else (-np.inf, np.inf)
    angle = value_of(pose, name)
    if angle is None:
        return float(np.clip(0.0, low, high))
    if not low <= angle <= high:
        raise InputError(
            f"pose has {angle:g} rad for the joint {name}, outside its range of {low:.4g} to "
            f"{high:.4g} rad"
        )
    return angle


def _follow_couplings(model: mujoco.MjModel, qpos: FloatArray) -> None:
    """Moves the joints that mimic another joint, whatever the order of the couplings."""
    followers, leaders = (
        model.jnt_qposadr[joints] for joints in (model.eq_obj1id, model.eq_obj2id)
    )
    for _ in range(model.neq):  # a chain of couplings has at most as many links
        angles = model.eq_data[:, 0] + model.eq_data[:, 1] * qpos[leaders]
        if np.array_equal(qpos[followers], angles):
            return
        qpos[followers] = angles


def _overlapping(model: mujoco.MjModel, data: mujoco.MjData) -> list[tuple[str, str]]:
    pairs = set()
    for contact in data.contact[: data.ncon]:
        first, second = sorted(int(model.geom_bodyid[geom]) for geom in contact.geom)
        if first and contact.dist < 0:
            pairs.add((first, second))
    return [(model.body(first).name, model.body(second).name) for first, second in sorted(pairs)]


PHYSICS_TIMESTEP = 0.002
"""Physics time step of a robot from a URDF, s."""

KEYFRAME = "stance"
"""Name of the keyframe with the initial pose."""

_MAX_LISTED = 6


def convert(document: Document, settings: MjcfSettings) -> Document:
    """Returns the MJCF of a URDF, with position servos and a keyframe.

    Args:
        document: The URDF, as returned by ``read_urdf``.
        settings: Settings with the gains and the pose. With ``base="free"`` the root has a free
            joint and there is a ground, with ``base="fixed"`` neither; without ``base`` the base is
            fixed if the root link is named ``world``.

    Raises:
        InputError: The URDF cannot be a robot; the message has the reason and the remedy.
    """
    urdf = document.root
    hinges = [j for j in urdf.findall("joint") if j.get("type") in HINGE_TYPES]
    driven = [j for j in hinges if j.find("mimic") is None]
    by_joint = {name: getattr(settings, name) for name in ("kp", "kd", "effort", "pose")}
    check_patterns(by_joint, [j.get("name", "") for j in hinges])
    spec = _imported(document)
    root = ET.Element("mujoco", {"model": urdf.get("name", "robot")})
    made = Document(root, document.assets, list(document.notes))
    # Links without an <inertial> have no mass, as URDF defines.
    ET.SubElement(root, "compiler", {"angle": "radian", "inertiafromgeom": "false"})
    _note_inertias(made, spec)
    option = {"timestep": repr(PHYSICS_TIMESTEP), "integrator": "implicitfast"}
    ET.SubElement(root, "option", option)
    made.section("asset").extend(meshes(spec))
    made.section("worldbody").extend(world_elements(spec))
    in_world = any(link.get("name") == "world" for link in urdf.findall("link"))
    if settings.base == "free" or (settings.base is None and not in_world):
        _free_base(made)
    _add_couplings(made, hinges)
    _add_servos(made, driven, settings)
    _add_stance(made, settings)
    return made


def _imported(document: Document) -> mujoco.MjSpec:
    """Returns the specification that MuJoCo's importer makes of a URDF."""
    # Kept: the folders (none), links on fixed joints, such as feet, and the visuals.
    flags = {"strippath": "false", "fusestatic": "false", "discardvisual": "false"}
    extension = ET.Element("mujoco")
    ET.SubElement(extension, "compiler", flags)
    document.root.insert(0, extension)
    with loading_a_model():
        return mujoco.MjSpec.from_string(document.text, assets=document.assets)


def _note_inertias(made: Document, spec: mujoco.MjSpec) -> None:
    replaced = [body.name for body in spec.bodies if body.mass and not is_rigid(body)]
    if replaced:
        made.notes.append(
            f"the inertia of {listed(replaced, _MAX_LISTED)} is that of no rigid body (a moment is "
            f"not above 0, or exceeds the sum of the others), and is replaced by the mean of its "
            f"moments"
        )


def _free_base(made: Document) -> None:
    """Adds a free joint to the root link, and a ground plane."""
    if not any(geom.get("contype") != "0" for geom in made.root.iter("geom")):
        raise InputError(
            "no link has a <collision>, so the robot would fall through the ground: give the "
            'links that meet the ground a <collision>, or fix the base with base = "fixed"'
        )
    roots = made.bodies()[:1]
    if len(made.section("worldbody").findall("body")) != 1:
        raise InputError(
            "expected one link on the link 'world', the root of the robot: keep the robot, and "
            "remove the other links"
        )
    name = roots[0].get("name", "")
    roots[0].insert(0, ET.Element("freejoint", {"name": f"{name}_root"}))
    ground = {"name": "ground", "type": "plane", "size": "0 0 1"}
    made.section("worldbody").insert(0, ET.Element("geom", ground))
    made.notes.append(f"the root link {name} moves freely, on a ground plane")


def _add_couplings(made: Document, hinges: list[ET.Element]) -> None:
    """Adds an equality constraint for each joint that mimics another joint."""
    known = {joint.get("name") for joint in hinges}
    for joint in hinges:
        mimic = joint.find("mimic")
        if mimic is None:
            continue
        leader = mimic.get("joint", "")
        if leader not in known:
            raise InputError(
                f"the joint {quoted(joint.get('name'))} mimics {quoted(leader)}, which is no "
                f"revolute or continuous joint of the URDF"
            )
        factor, offset = number(mimic, "multiplier", 1.0), number(mimic, "offset", 0.0)
        coupling = {
            "joint1": joint.get("name", ""),
            "joint2": leader,
            "polycoef": f"{offset!r} {factor!r} 0 0 0",
        }
        ET.SubElement(made.section("equality"), "joint", coupling)
        made.notes.append(f"{joint.get('name')} mimics {leader}, and gets no motor")


def _add_servos(made: Document, driven: list[ET.Element], settings: MjcfSettings) -> None:
    servos = [servo(joint, settings) for joint in driven]
    made.section("actuator").extend([element for element, _ in servos])
    names: dict[str, list[str]] = {}
    for joint, (_, gains) in zip(driven, servos, strict=True):
        names.setdefault(gains, []).append(joint.get("name", ""))
    for gains, joints in names.items():
        made.notes.append(f"position servos with {gains}: {listed(joints, _MAX_LISTED)}")


def _add_stance(made: Document, settings: MjcfSettings) -> None:
    """Adds the initial pose as a keyframe, and excludes the contacts of bodies that overlap."""
    found = stance(_compiled(made), settings.pose)
    for first, second in found.overlapping:
        pair = {"body1": first, "body2": second}
        ET.SubElement(made.section("contact"), "exclude", pair)
        made.notes.append(f"{first} and {second} overlap in the initial pose, and never touch")
    key = {"name": KEYFRAME, "qpos": format_numbers(found.qpos)}
    ET.SubElement(made.section("keyframe"), "key", key)


def _compiled(made: Document) -> mujoco.MjModel:
    """Returns the compiled model.

    Raises:
        InputError: MuJoCo cannot compile the model, such as a link that moves without mass.
    """
    try:
        return compile_model(made.text, made.assets)
    except InputError as error:
        if "mjMINVAL" not in str(error):
            raise
        raise InputError(
            f"{error}: give this link, or a link that is fixed to it, an <inertial> with a mass "
            f'and moments above 0, or fix the base with base = "fixed" if it is the root'
        ) from error
