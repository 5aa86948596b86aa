"""Reads a URDF: checks the tree, keeps the elements of links and joints, and reads the meshes.

The result has known elements and attributes only, and names no file outside its assets, so that
MuJoCo's importer reads nothing else.
"""

from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from posixpath import join, normpath, splitext
from types import MappingProxyType
from urllib.parse import unquote
from xml.etree import ElementTree as ET  # of checked texts

from selfmodel.errors import InputError
from selfmodel.robot.mjcf.document import Document, plain_name
from selfmodel.robot.mjcf.files import Files
from selfmodel.robot.mjcf.untrusted import MAX_DEPTH, MAX_FILE
from selfmodel.robot.model_checks import MAX_NUMBER

MAX_LINK_DEPTH = MAX_DEPTH - 10
"""Largest number of links from the root to an end; in MJCF, each link is nested in its parent."""

HINGE_TYPES = ("revolute", "continuous")
JOINT_TYPES = (*HINGE_TYPES, "fixed")

_MAX_QUOTED = 80

_REMEDIES = {
    "prismatic": "a limb's posture is the angles of its hinges, so replace it by a revolute joint "
    'or fix it with type="fixed"',
    "floating": "only the root link moves freely, and gets a free joint without this element: keep "
    "the robot, and remove the other bodies",
    "planar": 'replace it by revolute joints, or fix it with type="fixed"',
}


def quoted(text: str | None) -> str:
    """Returns a name of a URDF as part of an error message, at most 80 characters long."""
    return repr((text or "")[:_MAX_QUOTED])


def check_tree(root: ET.Element) -> str:
    """Checks the links and joints of a URDF, and returns the name of the root link.

    Args:
        root: The ``<robot>`` element.

    Raises:
        InputError: The links and joints do not form one tree of hinges.
    """
    links = _names(root, "link")
    _names(root, "joint")
    parents: dict[str, str] = {}
    for joint in root.findall("joint"):
        name = joint.get("name", "")
        parent, child = (_end(joint, end, links) for end in ("parent", "child"))
        if child in parents:
            raise InputError(
                f"the link {quoted(child)} has two parents, {quoted(parents[child])} and "
                f"{quoted(parent)}: expected a tree, so remove one of the joints "
                f"(the second is {quoted(name)})"
            )
        parents[child] = parent
    roots = [name for name in links if name not in parents]
    if len(roots) != 1:
        found = ", ".join(map(quoted, roots[:5])) or "none (the joints form a circle)"
        raise InputError(
            f"expected one link without a parent, the root of the robot, got {found}: keep the "
            f"robot, and connect its links by joints"
        )
    _check_depths(links, parents)
    return roots[0]


def _names(root: ET.Element, tag: str) -> Counter[str]:
    counts = Counter(element.get("name", "") for element in root.findall(tag))
    if tag == "link" and not counts:
        raise InputError("the URDF has no <link>: expected the links of a robot")
    for name, count in counts.items():
        if not name or count > 1:
            raise InputError(
                f"expected a different name for each <{tag}>, got {quoted(name)} {count} times"
            )
    return counts


def check_types(root: ET.Element) -> None:
    """Checks that all joints of a URDF are hinges, or fixed.

    Raises:
        InputError: A joint has another type; the message has the remedy.
    """
    for joint in root.findall("joint"):
        kind, name = joint.get("type", ""), joint.get("name", "")
        if kind not in JOINT_TYPES:
            remedy = _REMEDIES.get(kind, f"expected one of {', '.join(JOINT_TYPES)}")
            raise InputError(f"the joint {quoted(name)} has the type {quoted(kind)}: {remedy}")


def _end(joint: ET.Element, end: str, links: Collection[str]) -> str:
    element = joint.find(end)
    link = "" if element is None else element.get("link", "")
    if link not in links:
        raise InputError(
            f"the <{end}> of the joint {quoted(joint.get('name'))} is the link {quoted(link)}, "
            f"which the URDF does not have"
        )
    return link


def _check_depths(links: Collection[str], parents: dict[str, str]) -> None:
    depths: dict[str, int] = {}
    for link in links:
        chain = []
        at: str | None = link
        while at is not None and at not in depths:
            if at in chain:
                raise InputError(f"the joints form a circle through the link {quoted(at)}")
            chain.append(at)
            if len(chain) > MAX_LINK_DEPTH:
                raise InputError(f"the URDF has more than {MAX_LINK_DEPTH} links in one chain")
            at = parents.get(at)
        depth = -1 if at is None else depths[at]
        for name in reversed(chain):
            depth += 1
            depths[name] = depth
    if max(depths.values()) >= MAX_LINK_DEPTH:
        raise InputError(f"the URDF has more than {MAX_LINK_DEPTH} links in one chain")


READABLE = (".stl", ".obj")
"""Endings of the meshes of a URDF that MuJoCo reads."""

_PACKAGE_SCHEMES = ("package://", "model://")
_ABOVE = ("", "..", "../..", "../../..")
"""Folders of a package, from the folder of its URDF: ``NAME/urdf/x.urdf``, and one level deeper."""


@dataclass
class Meshes:
    """The meshes of a URDF, read into a document.

    Attributes:
        files: Source of the files, by their paths relative to the URDF.
        limit: Largest sum of the files, bytes.
        document: The URDF; the contents of the files are added to its assets.
    """

    files: Files
    limit: int
    document: Document
    _names: dict[str, str] = field(default_factory=dict)

    def find(self, uri: str) -> str | None:
        """Returns the path of a mesh relative to the URDF, or None if no readable file exists.

        A mesh in another format is replaced by the file of the same name that ends in ``.stl`` or
        ``.obj``, if there is one.
        """
        for path in _candidates(uri):
            stem, ending = splitext(path)
            other = [stem + readable for readable in READABLE]
            for name in [path] if ending.lower() in READABLE else other:
                if self.files.has(name):
                    return name
        return None

    def add(self, path: str, uri: str) -> str:
        """Reads a mesh, and returns its name among the assets.

        Args:
            path: Path of the file, as returned by ``find``.
            uri: The path in the URDF, for an error message.

        Raises:
            InputError: The files are too large.
        """
        if path not in self._names:
            assets = self.document.assets
            data = self.files.read(path, f"the file of a <mesh> ({quoted(uri)})", self.limit)
            if sum(map(len, assets.values())) + len(data) > self.limit:
                raise InputError(
                    f"the meshes of the URDF have over {self.limit} bytes: simplify them"
                )
            self._names[path] = plain_name(path, assets)
            assets[self._names[path]] = data
        return self._names[path]


def _candidates(uri: str) -> Iterator[str]:
    """Yields the possible paths of a file, relative to the URDF, the most specific first."""
    text = uri.replace("\\", "/")
    if text.startswith("file://"):
        yield unquote(text.removeprefix("file://"))
        return
    scheme = next((scheme for scheme in _PACKAGE_SCHEMES if text.startswith(scheme)), None)
    if scheme is None:
        yield normpath(text)
        return
    whole = unquote(text.removeprefix(scheme))
    _package, _, inside = whole.partition("/")
    for above in _ABOVE:
        yield normpath(join(above, inside))
        yield normpath(join(above, whole))


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
