"""Reads a URDF: keeps the elements of links and joints, and reads the meshes.

The result has known elements and attributes only, and names no file outside its assets, so that
MuJoCo's importer reads nothing else.
"""

from collections import Counter
from collections.abc import Mapping
from types import MappingProxyType
from xml.etree import ElementTree as ET  # of checked texts

from selfmodel.errors import InputError
from selfmodel.robot.mjcf.document.document import Document
from selfmodel.robot.mjcf.document.files import Files
from selfmodel.robot.mjcf.untrusted import MAX_FILE
from selfmodel.robot.model_checks import MAX_NUMBER
from selfmodel.robot.urdf.meshes import READABLE, Meshes
from selfmodel.robot.urdf.tree import check_tree, check_types, quoted

_ORIGIN = ("xyz", "rpy")
_KEPT: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "link": ("name",),
        "inertial": (),
        "origin": _ORIGIN,
        "mass": ("value",),
        "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
        "visual": (),
        "collision": (),
        "geometry": (),
        "box": ("size",),
        "sphere": ("radius",),
        "cylinder": ("radius", "length"),
        "capsule": ("radius", "length"),
        "mesh": ("filename", "scale"),
        "material": ("name",),
        "color": ("rgba",),
        "joint": ("name", "type"),
        "parent": ("link",),
        "child": ("link",),
        "axis": ("xyz",),
        "limit": ("lower", "upper", "effort", "velocity"),
        "dynamics": ("damping", "friction"),
        "mimic": ("joint", "multiplier", "offset"),
    }
)
"""Elements that are kept, with the attributes that are kept."""

_TEXTS = ("name", "type", "link", "joint", "filename")
"""Attributes with text; the others have numbers."""

_COUNTS: Mapping[str, int] = MappingProxyType(
    {"xyz": 3, "rpy": 3, "size": 3, "scale": 3, "rgba": 4}
)
"""Numbers of an attribute with more than one."""

_XACRO = "xacro"


def read_urdf(root: ET.Element, files: Files) -> Document:
    """Returns the document of a URDF, with its meshes read.

    Args:
        root: The ``<robot>`` element.
        files: Source of the files that the URDF names.

    Raises:
        InputError: The URDF is a xacro, its links form no tree, or the mesh of a collision is
            missing or has another format.
    """
    _refuse_xacro(root)
    main = check_tree(root)
    document = Document(ET.Element("robot", {"name": root.get("name") or "robot"}))
    left_out: Counter[str] = Counter()
    for element in root:
        if element.tag in ("link", "joint", "material"):
            document.root.append(_kept(element))
        else:
            left_out[element.tag] += 1
    if left_out:
        document.notes.append(f"elements that no robot needs are left out: {_counted(left_out)}")
    _drop_floating_joint(document, main)
    check_types(document.root)
    _fix_rangeless(document)
    _drop_empty_shapes(document)
    _read_meshes(document, Meshes(files, MAX_FILE, document))
    return document


def _refuse_xacro(root: ET.Element) -> None:
    for element in root.iter():
        if _XACRO in element.tag or any("${" in value for value in element.attrib.values()):
            raise InputError(
                f"expected a URDF, got a xacro (<{element.tag.rpartition('}')[2][:40]}>): expand "
                f"it first, with `xacro robot.urdf.xacro > robot.urdf`"
            )


def _kept(element: ET.Element) -> ET.Element:
    """Returns a copy of an element with the known attributes and children only.

    Of children that URDF has once, the first counts.
    """
    attributes = {
        name: element.get(name, "") for name in _KEPT[element.tag] if name in element.attrib
    }
    copy = ET.Element(element.tag, attributes)
    _check_numbers(copy)
    for child in element:
        once = child.tag not in ("visual", "collision")
        if child.tag in _KEPT and not (once and copy.find(child.tag) is not None):
            copy.append(_kept(child))
    return copy


def _drop_floating_joint(document: Document, main: str) -> None:
    """Removes a root link without a body that carries the robot by a floating joint."""
    link = next(link for link in document.root.findall("link") if link.get("name") == main)
    joints = [j for j in document.root.findall("joint") if _link_of(j, "parent") == main]
    has_body = any(element.tag in ("inertial", "collision") for element in link)
    if has_body or [joint.get("type") for joint in joints] != ["floating"]:
        return
    document.root.remove(link)
    document.root.remove(joints[0])
    document.notes.append(f"the link {main} and the joint {joints[0].get('name')} are left out")


def _fix_rangeless(document: Document) -> None:
    """Fixes the revolute joints with a range of zero width, and checks the other ranges."""
    for joint in document.root.findall("joint"):
        if joint.get("type") != "revolute":
            continue
        limit = joint.find("limit")
        ends = [] if limit is None else [number(limit, end, 0.0) for end in ("lower", "upper")]
        if not ends or ends[0] > ends[1]:
            raise InputError(
                f"the revolute joint {quoted(joint.get('name'))} needs a <limit> with lower below "
                f'upper, in rad: add it, or set type="continuous"'
            )
        if ends[0] == ends[1]:
            joint.set("type", "fixed")
            document.notes.append(
                f"the joint {joint.get('name')} has a range of {ends[0]:g} to {ends[1]:g} rad, "
                f"and is fixed"
            )


def number(element: ET.Element, attribute: str, default: float) -> float:
    """Returns the number of an attribute that ``read_urdf`` has checked."""
    return float(element.get(attribute, default))


def _check_numbers(element: ET.Element) -> None:
    """Checks that the attributes with numbers are numbers, and that masses are not negative."""
    for attribute, text in element.attrib.items():
        if attribute in _TEXTS:
            continue
        words = text.split()
        count = _COUNTS.get(attribute, 1)
        if len(words) != count or not all(map(_is_number, words)):
            raise InputError(
                f"expected {count} number{'s' if count > 1 else ''} in {attribute} of "
                f"<{element.tag}>, at most {MAX_NUMBER:g}, got {quoted(text)}"
            )
    if element.tag == "mass" and float(element.get("value", "0")) < 0:
        raise InputError(f"expected a mass of at least 0 kg, got {quoted(element.get('value'))}")


def _is_number(word: str) -> bool:
    try:
        return abs(float(word)) <= MAX_NUMBER
    except ValueError:
        return False


def _link_of(joint: ET.Element, end: str) -> str:
    element = joint.find(end)
    return "" if element is None else element.get("link", "")


def _drop_empty_shapes(document: Document) -> None:
    """Removes visuals and collisions without a shape, or with a shape of size 0."""
    dropped = 0
    for link in document.root.findall("link"):
        for part in [e for e in link if e.tag in ("visual", "collision")]:
            shape = part.find("geometry/*")
            if shape is None or any(
                float(size) == 0
                for name in ("size", "radius", "length")
                for size in shape.get(name, "").split()
            ):
                link.remove(part)
                dropped += 1
    if dropped:
        document.notes.append(f"{dropped} shapes of size 0 are left out")


def _read_meshes(document: Document, meshes: Meshes) -> None:
    """Reads the meshes, and removes the visuals whose mesh is missing or has another format."""
    left_out: Counter[str] = Counter()
    for link in document.root.findall("link"):
        for part in [e for e in link if e.tag in ("visual", "collision")]:
            mesh = part.find("geometry/mesh")
            if mesh is None:
                continue
            uri = mesh.get("filename", "")
            path = meshes.find(uri)
            if path is not None:
                mesh.set("filename", meshes.add(path, uri))
            elif part.tag == "visual":
                link.remove(part)
                left_out[_reason(uri)] += 1
            else:
                raise InputError(
                    f"the collision of the link {quoted(link.get('name'))} needs the mesh "
                    f"{quoted(uri)}, which is missing, lies outside the folders of the model, or "
                    f"is no STL or OBJ: save the mesh as .stl, or name a folder that contains it, "
                    f"with --set assets=DIR"
                )
    for reason, count in left_out.items():
        document.notes.append(f"{count} visual meshes are left out: {reason}")


def _reason(uri: str) -> str:
    ending = "." + uri.rpartition(".")[2].lower()
    if ending in READABLE:
        return f"their files were not found, such as {quoted(uri)}"
    return f"MuJoCo reads no {ending[:10]}, expected {' or '.join(READABLE)}"


def _counted(counts: Counter[str]) -> str:
    return ", ".join(f"{count} <{tag[:40]}>" for tag, count in counts.most_common(8))
