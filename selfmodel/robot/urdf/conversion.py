"""Converts a URDF to MJCF: MuJoCo's importer reads the bodies; motors and a stance are added."""

from xml.etree import ElementTree as ET  # of checked texts

import mujoco
import numpy as np

from selfmodel.errors import InputError
from selfmodel.robot.mjcf.document import Document
from selfmodel.robot.mjcf.expand import format_numbers
from selfmodel.robot.mjcf.mujoco_errors import compile_model, loading_a_model
from selfmodel.robot.mjcf.settings import MjcfSettings
from selfmodel.robot.urdf.bodies import bodies, inertia_matrix, meshes
from selfmodel.robot.urdf.servos import check_patterns, servo
from selfmodel.robot.urdf.stance import stance
from selfmodel.robot.urdf.tree import HINGE_TYPES

PHYSICS_TIMESTEP = 0.002
"""Physics time step of a robot from a URDF, s."""

_MAX_LISTED = 6


def convert(document: Document, settings: MjcfSettings) -> Document:
    """Returns the MJCF of a URDF, with a free joint, position servos, ground and a keyframe.

    Args:
        document: The URDF, as returned by ``read_urdf``.
        settings: Settings with the gains and the pose.

    Raises:
        InputError: The URDF cannot be a robot; the message has the reason and the remedy.
    """
    urdf = document.root
    hinges = [j for j in urdf.findall("joint") if j.get("type") in HINGE_TYPES]
    driven = [j for j in hinges if j.find("mimic") is None]
    check_patterns(settings, [j.get("name", "") for j in hinges])
    spec = _imported(document)
    root = ET.Element("mujoco", {"model": urdf.get("name", "robot")})
    made = Document(root, document.assets, list(document.notes))
    _add_compiler(made, spec)
    option = {"timestep": repr(PHYSICS_TIMESTEP), "integrator": "implicitfast"}
    ET.SubElement(root, "option", option)
    made.section("asset").extend(meshes(spec))
    world = made.section("worldbody")
    ground = {"name": "ground", "type": "plane", "size": "0 0 1"}
    ET.SubElement(world, "geom", ground)
    trees = bodies(spec)
    world.extend(trees)
    _add_free_joint(made, trees[0])
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


def _add_compiler(made: Document, spec: mujoco.MjSpec) -> None:
    """Adds the compiler options; links without an ``<inertial>`` have no mass, as URDF defines."""
    compiler = ET.SubElement(made.root, "compiler", {"angle": "radian", "inertiafromgeom": "false"})
    unbalanced = []
    for body in spec.bodies:
        if body.mass:
            moments = np.linalg.eigvalsh(inertia_matrix(body))
            if moments[0] + moments[1] < moments[2]:
                unbalanced.append(body.name)
    if unbalanced:
        compiler.set("balanceinertia", "true")
        made.notes.append(
            f"the inertia of {_listed(unbalanced)} is of no rigid body (two moments sum to less "
            f"than the third), and is replaced by the mean of the moments"
        )


def _add_free_joint(made: Document, root: ET.Element) -> None:
    index = 1 if root.find("inertial") is not None else 0
    root.insert(index, ET.Element("freejoint"))
    made.notes.append(f"the root link {root.get('name')} moves freely, by a free joint")


def _add_couplings(made: Document, hinges: list[ET.Element]) -> None:
    """Adds the couplings of the joints that mimic another joint, which MuJoCo's importer reads."""
