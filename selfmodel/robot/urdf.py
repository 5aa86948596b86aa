"""Converts a URDF to MJCF: checked, its bodies read by MuJoCo, with servos and a stance.

Only known elements and attributes reach MuJoCo's importer, and no name of a file outside the
assets, so that it reads nothing else.
"""

import math
from collections import Counter
from collections.abc import Collection, Mapping
from xml.etree import ElementTree as ET  # of checked texts

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.errors import InputError, listed
from selfmodel.robot.anatomy import UNKNOWN_GROUND
from selfmodel.robot.contacts import ground_contact_geoms
from selfmodel.robot.mjcf.pose import lowest_point
from selfmodel.robot.mjcf.settings import JointValues, MjcfSettings, check_patterns, value_of
from selfmodel.robot.mjcf.untrusted import MAX_DEPTH, Files
from selfmodel.robot.mjcf.work import Work, format_numbers
from selfmodel.robot.mujoco_errors import loading_a_model
from selfmodel.robot.robot import MAX_NUMBER
from selfmodel.robot.urdf_bodies import is_rigid, mesh_elements, world_elements
from selfmodel.robot.urdf_meshes import SHAPES, quoted, read_meshes

MAX_LINK_DEPTH = MAX_DEPTH - 10
"""Largest number of links from the root to an end; in MJCF, each link is nested in its parent."""

FULL_EFFORT_ERROR = 0.125
"""Position error at which a servo without the setting ``kp`` exerts its full effort, rad; half of
the joint's range, if that is less. Gaits of a hexapod that were evolved with four times as much
walk on the give of its servos, and not in another simulator (``docs/results/hexapod.md``)."""

DAMPING_TIMES = (0.02, 0.1)
"""Least and greatest kd / kp of a servo without the setting ``kd``, s. In between, the damping
equals the effort at the velocity limit."""

ROTOR_TIME = 0.01
"""Inertia of a servo's rotor, seen at its joint, relative to effort / velocity limit, s: the time
in which a free motor reaches 63 % of that speed. About 6 ms for a Go2's and a Mini Cheetah's
motors, 13 ms for a Dynamixel MX-64."""

MAX_ROTOR = 100.0
"""Largest inertia of a rotor at its joint, kg m²; that of the largest industrial robots is less."""

UNLIMITED_RANGE = (-math.pi, math.pi)
"""Command range of a continuous joint, rad."""

PHYSICS_TIMESTEP = 0.002
"""Physics time step of a robot from a URDF, s."""

CONE = "elliptic"
"""Cone of the friction of contacts: equal in all directions, as Coulomb's. MuJoCo's default, a
pyramid, holds 0.71 of the force along its diagonals. The quadrupeds of MuJoCo Menagerie that are
made from URDFs (A1, Go1, Go2) are elliptic, too."""

HINGE_TYPES = ("revolute", "continuous")
JOINT_TYPES = (*HINGE_TYPES, "fixed")
_REMEDIES = {
    "prismatic": "a limb's posture is the angles of its hinges, so replace it by a revolute joint "
    'or fix it with type="fixed"',
    "floating": "only the root link moves freely, and gets a free joint without this element: keep "
    "the robot, and remove the other bodies",
    "planar": 'replace it by revolute joints, or fix it with type="fixed"',
}

_MAX_LISTED = 6

_KEPT: Mapping[str, list[str]] = {
    tag: attributes
    for tag, *attributes in map(
        str.split,
        (
            *("link name", "inertial", "origin xyz rpy", "mass value"),
            *("inertia ixx ixy ixz iyy iyz izz", "visual", "collision", "geometry", "box size"),
            *("sphere radius", "cylinder radius length", "capsule radius length"),
            *("mesh filename scale", "material name", "color rgba", "joint name type"),
            *("parent link", "child link", "axis xyz", "limit lower upper effort velocity"),
            *("dynamics damping friction", "mimic joint multiplier offset"),
        ),
    )
}
"""Elements that are kept, with the attributes that are kept."""

_TEXTS = ("name", "type", "link", "joint", "filename")
"""Attributes with text; the others have numbers."""

_COUNTS: Mapping[str, int] = {"xyz": 3, "rpy": 3, "size": 3, "scale": 3, "rgba": 4}
"""Numbers of an attribute with more than one."""


def read_urdf(root: ET.Element, files: Files, settings: MjcfSettings) -> Work:
    """Returns the work on the MJCF of a URDF, with position servos and a keyframe.

    With ``base="free"`` the root has a free joint and there is a ground, with ``base="fixed"``
    neither; without ``base`` the base is fixed if the root link is named ``world``.
    """
    work = Work(ET.Element("mujoco", {"model": root.get("name") or "robot"}), settings)
    urdf = _checked(root, work)
    read_meshes(urdf, work, files)
    hinges = [j for j in urdf.findall("joint") if j.get("type") in HINGE_TYPES]
    for values in (settings.kp, settings.kd, settings.effort, settings.velocity, settings.pose):
        check_patterns(values, [j.get("name", "") for j in hinges])
    # Kept: the folders (none), links on fixed joints, such as feet, and the visuals.
    flags = {"strippath": "false", "fusestatic": "false", "discardvisual": "false"}
    extension = ET.Element("mujoco")
    ET.SubElement(extension, "compiler", flags)
    urdf.insert(0, extension)
    with loading_a_model():
        text = ET.tostring(urdf, encoding="unicode")
        spec = mujoco.MjSpec.from_string(text, assets=work.assets)
    replaced = [body.name for body in spec.bodies if body.mass and not is_rigid(body)]
    if replaced:
        work.notes.append(
            f"the inertia of {listed(replaced, _MAX_LISTED)} is that of no rigid body (a moment is "
            f"not above 0, or exceeds the sum of the others), and is replaced by the mean of its "
            f"moments"
        )
    # Links without an <inertial> have no mass, as URDF defines.
    work.section("compiler").attrib.update(angle="radian", inertiafromgeom="false")
    option = {"timestep": repr(PHYSICS_TIMESTEP), "integrator": "implicitfast", "cone": CONE}
    work.section("option").attrib.update(option)
    work.section("asset").extend(mesh_elements(spec))
    work.section("worldbody").extend(world_elements(spec))
    in_world = any(link.get("name") == "world" for link in urdf.findall("link"))
    if settings.base == "free" or (settings.base is None and not in_world):
        _free_base(work)
    _add_couplings(work, hinges)
    _add_servos(work, hinges)
    _add_stance(work)
    return work


def _checked(root: ET.Element, work: Work) -> ET.Element:
    """Returns a URDF with the known elements of a tree of hinges, and with notes on the rest."""
    for element in root.iter():
        if "xacro" in element.tag or any("${" in value for value in element.attrib.values()):
            raise InputError(
                f"expected a URDF, got a xacro (<{element.tag.rpartition('}')[2][:40]}>): expand "
                f"it first, with `xacro robot.urdf.xacro > robot.urdf`"
            )
    main = _check_tree(root)
    urdf = ET.Element("robot", {"name": root.get("name") or "robot"})
    urdf.extend([_kept(e) for e in root if e.tag in ("link", "joint", "material")])
    left_out = Counter(e.tag for e in root if e.tag not in ("link", "joint", "material"))
    if left_out:
        counts = ", ".join(f"{count} <{tag[:40]}>" for tag, count in left_out.most_common(8))
        work.notes.append(f"elements that no robot needs are left out: {counts}")
    _drop_floating_joint(urdf, main, work)
    for joint in urdf.findall("joint"):
        kind, name = joint.get("type", ""), joint.get("name", "")
        if kind not in JOINT_TYPES:
            remedy = _REMEDIES.get(kind, f"expected one of {', '.join(JOINT_TYPES)}")
            raise InputError(f"the joint {quoted(name)} has the type {quoted(kind)}: {remedy}")
        if kind == "revolute":
            _check_range(joint, work)
    return urdf


def _check_tree(root: ET.Element) -> str:
    """Checks that the links and joints of a URDF form one tree, and returns the root link."""
    links = _names(root, "link")
    _names(root, "joint")
    if not links:
        raise InputError("the URDF has no <link>: expected the links of a robot")
    parents = _parents(root, links)
    for link in links:
        chain = [link]
        while chain[-1] in parents:
            chain.append(parents[chain[-1]])
            if chain[-1] in chain[:-1]:
                raise InputError(f"the joints form a circle, which carries the link {quoted(link)}")
            if len(chain) > MAX_LINK_DEPTH:
                raise InputError(f"the URDF has more than {MAX_LINK_DEPTH} links in one chain")
    roots = [name for name in links if name not in parents]
    if len(roots) > 1:
        raise InputError(
            f"expected one link without a parent, the root of the robot, got "
            f"{', '.join(map(quoted, roots[:5]))}: keep the robot, and connect its links by joints"
        )
    return roots[0]


def _parents(root: ET.Element, links: Collection[str]) -> dict[str, str]:
    parents: dict[str, str] = {}
    for joint in root.findall("joint"):
        name = quoted(joint.get("name"))
        for end in ("parent", "child"):
            if _link_of(joint, end) not in links:
                raise InputError(
                    f"the <{end}> of the joint {name} is the link {quoted(_link_of(joint, end))}, "
                    f"which the URDF does not have"
                )
        parent, child = _link_of(joint, "parent"), _link_of(joint, "child")
        if child in parents:
            raise InputError(
                f"the link {quoted(child)} has two parents, {quoted(parents[child])} and "
                f"{quoted(parent)}: expected a tree, so remove one of the joints "
                f"(the second is {name})"
            )
        parents[child] = parent
    return parents


def _names(root: ET.Element, tag: str) -> Counter[str]:
    names = Counter(element.get("name", "") for element in root.findall(tag))
    for name, count in names.items():
        if not name or count > 1:
            raise InputError(
                f"expected a different name for each <{tag}>, got {quoted(name)} {count} times"
            )
    return names


def _link_of(joint: ET.Element, end: str) -> str:
    element = joint.find(end)
    return "" if element is None else element.get("link", "")


def _kept(element: ET.Element) -> ET.Element:
    """Returns a copy of an element with the known attributes and children only.

    Of children that URDF has once, the first counts.
    """
    known = {name: element.get(name, "") for name in _KEPT[element.tag] if name in element.attrib}
    copy = ET.Element(element.tag, known)
    for name, text in known.items():
        if name not in _TEXTS:
            _check_numbers(element.tag, name, text)
    for child in element:
        once = child.tag not in SHAPES
        if child.tag in _KEPT and not (once and copy.find(child.tag) is not None):
            copy.append(_kept(child))
    return copy


def _check_numbers(tag: str, name: str, text: str) -> None:
    words, count = text.split(), _COUNTS.get(name, 1)
    try:
        valid = len(words) == count and all(abs(float(word)) <= MAX_NUMBER for word in words)
    except ValueError:
        valid = False
    if not valid:
        raise InputError(
            f"expected {count} number{'s' if count > 1 else ''} in {name} of <{tag}>, at most "
            f"{MAX_NUMBER:g}, got {quoted(text)}"
        )
    if tag == "mass" and float(text) < 0:
        raise InputError(f"expected a mass of at least 0 kg, got {quoted(text)}")


def _drop_floating_joint(urdf: ET.Element, main: str, work: Work) -> None:
    """Removes a root link without a body that carries the robot by a floating joint."""
    link = next(link for link in urdf.findall("link") if link.get("name") == main)
    joints = [joint for joint in urdf.findall("joint") if _link_of(joint, "parent") == main]
    has_body = any(element.tag in ("inertial", "collision") for element in link)
    if not has_body and [joint.get("type") for joint in joints] == ["floating"]:
        urdf.remove(link)
        urdf.remove(joints[0])
        work.notes.append(f"the link {main} and the joint {joints[0].get('name')} are left out")


def _check_range(joint: ET.Element, work: Work) -> None:
    limit = joint.find("limit")
    low, high = (1.0, 0.0) if limit is None else (_number(limit, e) for e in ("lower", "upper"))
    if low > high:
        raise InputError(
            f"the revolute joint {quoted(joint.get('name'))} needs a <limit> with lower below "
            f'upper, in rad: add it, or set type="continuous"'
        )
    if low == high:
        joint.set("type", "fixed")
        work.notes.append(
            f"the joint {joint.get('name')} has a range of {low:g} to {high:g} rad, and is fixed"
        )


def _number(element: ET.Element, attribute: str, default: float = 0.0) -> float:
    return float(element.get(attribute, default))


def _free_base(work: Work) -> None:
    if not any(geom.get("contype") != "0" for geom in work.root.iter("geom")):
        raise InputError(
            "no link has a <collision>, so the robot would fall through the ground: give the "
            'links that meet the ground a <collision>, or fix the base with base = "fixed"'
        )
    world = work.section("worldbody")
    roots = world.findall("body")
    if len(roots) != 1:
        raise InputError(
            "expected one link on the link 'world', the root of the robot: keep the robot, and "
            "remove the other links"
        )
    name = roots[0].get("name", "")
    roots[0].insert(0, ET.Element("freejoint", {"name": f"{name}_root"}))
    world.insert(0, ET.Element("geom", {"name": "ground", "type": "plane", "size": "0 0 1"}))
    ET.SubElement(work.section("custom"), "numeric", {"name": UNKNOWN_GROUND, "data": "1"})
    work.notes.append(f"the root link {name} moves freely, on a ground plane")


def _add_couplings(work: Work, hinges: list[ET.Element]) -> None:
    known = {joint.get("name") for joint in hinges}
    for joint in hinges:
        mimic, name = joint.find("mimic"), joint.get("name", "")
        if mimic is None:
            continue
        leader = mimic.get("joint", "")
        if leader not in known:
            raise InputError(
                f"the joint {quoted(name)} mimics {quoted(leader)}, which is no revolute or "
                f"continuous joint of the URDF"
            )
        factor, offset = _number(mimic, "multiplier", 1.0), _number(mimic, "offset")
        coupling = {"joint1": name, "joint2": leader, "polycoef": f"{offset!r} {factor!r} 0 0 0"}
        ET.SubElement(work.section("equality"), "joint", coupling)
        work.notes.append(f"{name} mimics {leader}, and gets no motor")


def _add_servos(work: Work, hinges: list[ET.Element]) -> None:
    """Adds a position servo for each joint that mimics no other.

    A servo has no torque left at the velocity limit of its joint, whatever its gains: the joint has
    a resistance that is the effort there, and grows with the square of the speed. Unlike the linear
    one of a motor's induced voltage, it is small at the low speeds of joints with a load, where
    MuJoCo computes contacts without it. Without the inertia of a rotor, the damping of a servo
    stops a light limb within a time step: a search finds gaits that no robot walks.
    """
    settings, names = work.settings, dict[str, list[str]]()
    elements = {j.get("name"): j for j in work.section("worldbody").iter("joint")}
    actuators = work.section("actuator")
    for joint in [hinge for hinge in hinges if hinge.find("mimic") is None]:
        name, limit = joint.get("name", ""), joint.find("limit")
        limit = ET.Element("limit") if limit is None else limit
        effort = value_of(settings.effort, name)
        effort = _number(limit, "effort") if effort is None else effort
        if effort <= 0:
            raise InputError(
                f"the joint {quoted(name)} has no effort limit above 0: add it to its <limit>, or "
                f"set the torque of such joints, in N m, with effort = ..."
            )
        low, high = UNLIMITED_RANGE
        if joint.get("type") == "revolute":
            low, high = _number(limit, "lower"), _number(limit, "upper")
        kp, kd = value_of(settings.kp, name), value_of(settings.kd, name)
        if kp is None:
            kp = effort / min(FULL_EFFORT_ERROR, (high - low) / 2)
        velocity = value_of(settings.velocity, name)
        velocity = _number(limit, "velocity") if velocity is None else velocity
        rotor = value_of(settings.armature, name)
        if velocity > 0:
            rotor = ROTOR_TIME * effort / velocity if rotor is None else rotor
            if rotor > MAX_ROTOR:
                raise InputError(
                    f"the joint {quoted(name)} has a velocity limit of {velocity:g} rad/s at an "
                    f"effort of {effort:g} N m, as if its rotor had {rotor:g} kg m²: correct the "
                    f"velocity limit, or set velocity = 0 for none"
                )
            own = elements[name].get("damping", "0").split()[0]
            elements[name].set("damping", f"{own} {effort / velocity / velocity!r}")
        if kd is None:
            least, most = (kp * t for t in DAMPING_TIMES)
            kd = most if velocity <= 0 else min(max(effort / velocity, least), most)
        servo = {
            "name": name,
            "joint": name,
            "kp": repr(kp),
            "kv": repr(kd),
            "ctrlrange": f"{low!r} {high!r}",
            "ctrllimited": "true",
            "forcerange": f"{-effort!r} {effort!r}",
            "forcelimited": "true",
        }
        ET.SubElement(actuators, "position", servo)
        elements[name].set("armature", repr(rotor or 0.0))
        speed = f", {velocity:.3g} rad/s" if velocity > 0 else ""
        speed += f", armature {rotor:.2g} kg m²" if rotor else ""
        names.setdefault(f"kp {kp:.3g}, kd {kd:.3g}, {effort:.3g} N m{speed}", []).append(name)
    for gains, joints in names.items():
        work.notes.append(f"position servos with {gains}: {listed(joints, _MAX_LISTED)}")


def _add_stance(work: Work) -> None:
    """Adds the initial pose as a keyframe, and excludes the contacts of bodies that overlap.

    The lowest colliding geom is at height 0 if the base is free.
    """
    try:
        model = work.model
    except InputError as error:
        if "mjMINVAL" not in str(error):
            raise
        raise InputError(
            f"{error}: give this link, or a link that is fixed to it, an <inertial> with a mass "
            f'and moments above 0, or fix the base with base = "fixed" if it is the root'
        ) from error
    data = mujoco.MjData(model)
    for j in np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE):
        data.qpos[model.jnt_qposadr[j]] = _angle(model, int(j), work.settings.pose)
    _follow_couplings(model, data.qpos)
    mujoco.mj_kinematics(model, data)
    free = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
    if len(free) and ground_contact_geoms(model):
        data.qpos[model.jnt_qposadr[free[0]] + 2] -= lowest_point(model, data)
        mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_collision(model, data)
    pairs = np.sort(model.geom_bodyid[data.contact.geom[data.contact.dist < 0]], axis=1)
    for first, second in np.unique(pairs[pairs[:, 0] > 0], axis=0):
        bodies = {"body1": model.body(first).name, "body2": model.body(second).name}
        ET.SubElement(work.section("contact"), "exclude", bodies)
        one, other = bodies.values()
        work.notes.append(f"{one} and {other} overlap in the initial pose, and never touch")
    key = {"name": "stance", "qpos": format_numbers(data.qpos)}
    ET.SubElement(work.section("keyframe"), "key", key)


def _angle(model: mujoco.MjModel, joint: int, pose: JointValues) -> float:
    """Returns the angle of a joint in a pose, or else the angle of its range nearest to 0."""
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
