"""Converts a URDF to MJCF: MuJoCo's importer reads the bodies; motors and a stance are added."""

from xml.etree import ElementTree as ET  # of checked texts

import mujoco

from selfmodel.errors import InputError
from selfmodel.robot.mjcf.document.document import Document
from selfmodel.robot.mjcf.document.expand import format_numbers
from selfmodel.robot.mjcf.joint_values import check_patterns
from selfmodel.robot.mjcf.settings import MjcfSettings
from selfmodel.robot.mujoco_errors import compile_model, loading_a_model
from selfmodel.robot.urdf.bodies import meshes, world_elements
from selfmodel.robot.urdf.inertia import is_rigid
from selfmodel.robot.urdf.reading import number
from selfmodel.robot.urdf.servos import servo
from selfmodel.robot.urdf.stance import stance
from selfmodel.robot.urdf.tree import HINGE_TYPES, quoted

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
            f"the inertia of {_listed(replaced)} is that of no rigid body (a moment is not above "
            f"0, or exceeds the sum of the others), and is replaced by the mean of its moments"
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
        made.notes.append(f"position servos with {gains}: {_listed(joints)}")


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


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - _MAX_LISTED} more" if len(names) > _MAX_LISTED else ""
    return ", ".join(names[:_MAX_LISTED]) + more
