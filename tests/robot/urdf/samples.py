"""URDF files for tests."""

from pathlib import Path
from xml.etree import ElementTree as ET

from selfmodel.robot.mjcf.document import Document
from selfmodel.robot.mjcf.files import InMemory
from selfmodel.robot.mjcf.settings import checked_settings
from selfmodel.robot.mjcf.untrusted import parse_xml
from selfmodel.robot.urdf import read_urdf
from selfmodel.robot.urdf_conversion import convert

CUBE = """v 0 0 0\nv .1 0 0\nv 0 .1 0\nv 0 0 .1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"""
"""A tetrahedron as OBJ."""

INERTIAL = """<inertial><mass value="{mass}"/>
<inertia ixx="{i}" iyy="{i}" izz="{i}" ixy="0" ixz="0" iyz="0"/></inertial>"""
BALL = '<collision><geometry><sphere radius="0.03"/></geometry></collision>'
BOX = '<collision><geometry><box size="0.4 0.2 0.1"/></geometry></collision>'
LIMIT = '<limit lower="{low}" upper="{high}" effort="{effort}" velocity="{velocity}"/>'


def link(name: str, mass: float = 1.0, body: str = "") -> str:
    """Returns a link, without mass if the mass is 0."""
    inertial = INERTIAL.format(mass=mass, i=0.01 * mass) if mass else ""
    return f'<link name="{name}">{inertial}{body}</link>'


def joint(
    name: str,
    parent: str,
    child: str,
    *,
    kind: str = "revolute",
    xyz: str = "0 0 -0.2",
    axis: str = "0 1 0",
    low: float = -1.0,
    high: float = 1.0,
    effort: float = 10.0,
    velocity: float = 10.0,
    more: str = "",
) -> str:
    """Returns a joint."""
    limit = LIMIT.format(low=low, high=high, effort=effort, velocity=velocity)
    return f"""<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>
    <origin xyz="{xyz}"/><axis xyz="{axis}"/>{limit}{more}</joint>"""


def leg(side: str, y: float) -> str:
    """Returns a leg with hip, knee and a foot on a fixed joint."""
    return (
        link(f"{side}_thigh")
        + link(f"{side}_shin", 0.5)
        + link(f"{side}_foot", 0.1, BALL)
        + joint(f"{side}_hip", "trunk", f"{side}_thigh", xyz=f"0 {y} 0")
        + joint(f"{side}_knee", f"{side}_thigh", f"{side}_shin", low=-2.0, high=-0.5)
        + joint(f"{side}_ankle", f"{side}_shin", f"{side}_foot", kind="fixed")
    )


def urdf(*parts: str) -> str:
    """Returns a URDF with the parts."""
    return f'<robot name="walker">{"".join(parts)}</robot>'


WALKER = urdf(link("trunk", 4.0, BOX), leg("left", 0.1), leg("right", -0.1))
"""A two-legged robot whose feet are fixed links."""


def read(text: str, files: dict[str, str | bytes] | None = None) -> Document:
    """Returns the document of a URDF in memory."""
    return read_urdf(parse_xml(text.encode()), InMemory(files or {}))


def converted(
    text: str,
    files: dict[str, str | bytes] | None = None,
    **settings: object,
) -> Document:
    """Returns the MJCF of a URDF in memory."""
    return convert(read(text, files), checked_settings(settings))


def elements(document: Document, path: str) -> dict[str, ET.Element]:
    """Returns the elements of a document at a path, by name."""
    return {element.get("name", ""): element for element in document.root.iterfind(path)}


def written(folder: Path, text: str = WALKER, toml: str = "") -> Path:
    """Writes a URDF and its settings into a folder, and returns the path of the URDF."""
    path = folder / "walker.urdf"
    path.write_text(text)
    if toml:
        path.with_suffix(".toml").write_text(toml)
    return path
