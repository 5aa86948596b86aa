"""MJCF document: an MJCF without includes, and the contents of the files that it names."""

import re
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import PurePosixPath
from posixpath import dirname, join, normpath
from xml.etree import ElementTree as ET  # _check_xml refuses document types and deep trees
from xml.parsers import expat  # the same

from selfmodel.errors import InputError
from selfmodel.robot.mjcf.document.files import Files
from selfmodel.robot.mjcf.untrusted import MAX_DEPTH, MAX_FILE, MAX_TEXT

_FOLDER_ATTRIBUTES = {"meshdir": ("mesh", "skin", "flex", "hfield"), "texturedir": ("texture",)}
_NAMED_BY_FILE = ("mesh", "texture", "hfield")
_TETRAHEDRON = "0 0 0 1 0 0 0 1 0 0 0 1"
_SPECIAL_CHARACTERS = re.compile(r"[^A-Za-z0-9_.-]")


@dataclass(eq=False)
class Document:
    """An MJCF that is being adapted.

    Attributes:
        root: The ``<mujoco>`` element.
        assets: Contents of the files that the MJCF names, by names without folders.
        notes: Descriptions of the changes, one sentence each.
        missing: Error messages of the meshes without files, by name; they have placeholders.
    """

    root: ET.Element
    assets: dict[str, bytes] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    missing: dict[str, str] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """The MJCF as text."""
        return ET.tostring(self.root, encoding="unicode")

    @property
    def angle_unit(self) -> float:
        """Value of an angle of 1 rad in the unit of the MJCF."""
        units = [c.get("angle") for c in self.root.iter("compiler") if c.get("angle")]
        return 1.0 if units[-1:] == ["radian"] else 180.0 / 3.141592653589793

    def section(self, name: str) -> ET.Element:
        """Returns the first section of that name, and adds the section if there is none."""
        section = self.root.find(name)
        return ET.SubElement(self.root, name) if section is None else section

    def children(self, section: str) -> list[ET.Element]:
        """Returns the children of all sections of that name, in order."""
        return [child for part in self.root.findall(section) for child in part]

    def bodies(self) -> list[ET.Element]:
        """Returns every ``<body>``, a parent before its children."""
        return [body for world in self.root.findall("worldbody") for body in world.iter("body")]


def read_document(mjcf: bytes, files: Files, name: str = "") -> Document:
    """Returns the document of an MJCF, with includes inserted and all named files read.

    Args:
        mjcf: The MJCF.
        files: Source of the files that the MJCF includes and names.
        name: Name of the MJCF among the files, which it cannot include.

    Raises:
        InputError: A file is missing, too large, outside the folder, or no MJCF.
    """
    if len(mjcf) > MAX_TEXT:
        raise InputError(f"expected an MJCF of at most {MAX_TEXT} bytes, got {len(mjcf)}")
    root = parse_xml(mjcf)
    if root.tag != "mujoco":
        raise InputError(f"expected an MJCF, which begins with <mujoco>, got <{root.tag[:40]}>")
    _include(root, files, "", {normpath(name)}, MAX_TEXT)
    document = Document(root)
    _read_assets(document, files, MAX_FILE)
    return document


def parse_xml(data: bytes) -> ET.Element:
    """Returns the root element of an XML text.

    Raises:
        InputError: The text is no XML, has a document type, or is nested too deeply.
    """
    _check_xml(data)
    try:
        return ET.fromstring(data)  # noqa: S314  # _check_xml refuses unsafe XML
    except (ET.ParseError, ValueError) as error:
        raise InputError(f"expected an MJCF or URDF file, got no XML: {error}") from error


def _check_xml(data: bytes) -> None:
    """Refuses document types (and with them entities) and deep trees, before a tree is built."""
    depth = 0

    def start(_tag: str, _attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > MAX_DEPTH:
            raise InputError(f"the MJCF has more than {MAX_DEPTH} elements within each other")

    def end(_tag: str) -> None:
        nonlocal depth
        depth -= 1

    def doctype(*_: object) -> None:
        raise InputError("the MJCF has a <!DOCTYPE>, which no MJCF needs: remove the <!DOCTYPE>")

    parser = expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(data, True)
    except (expat.ExpatError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"expected an MJCF or URDF file, got no XML: {error}") from error


def _include(parent: ET.Element, files: Files, folder: str, included: set[str], limit: int) -> None:
    """Replaces each ``<include>`` by the content of its file, recursively.

    Args:
        parent: Element whose descendants are replaced, in place.
        files: Source of the files.
        folder: Folder of the file that contains ``parent``.
        included: Paths of the files that are included already; extended.
        limit: Largest size of an included file, bytes.
    """
    for index, child in reversed(list(enumerate(parent))):
        if child.tag != "include":
            _include(child, files, folder, included, limit)
            continue
        name = child.get("file", "")
        # MuJoCo's order: relative to the folder of the main file, then of the including file.
        path = normpath(name if files.has(name) else join(folder, name))
        data = files.read(path, f"a file to <include> ({name!r})", limit)
        if path in included:
            raise InputError(f"the MJCF includes {name!r} twice: name each file once")
        included.add(path)
        inner = parse_xml(data)
        _include(inner, files, dirname(path), included, limit)
        parent[index : index + 1] = list(inner)


def _read_assets(document: Document, files: Files, limit: int) -> None:
    """Reads the files that the MJCF names, and renames them to names without folders."""
    folders = _pop_asset_folders(document.root)
    names: dict[str, str] = {}
    for element in document.root.iter():
        for attribute, name in list(element.attrib.items()):
            if not attribute.startswith("file") or not name:
                continue
            path = str(PurePosixPath(folders.get(element.tag, ""), name))
            if element.tag == "mesh" and not files.has(path):
                _add_placeholder(document, element, files, path)
                continue
            if path not in names:
                what = f"the file of a <{element.tag}> ({name!r})"
                data = files.read(path, what, limit)
                if sum(map(len, document.assets.values())) + len(data) > limit:
                    raise InputError(
                        f"the files of the MJCF have over {limit} bytes: simplify them"
                    )
                names[path] = plain_name(path, document.assets)
                document.assets[names[path]] = data
            element.set(attribute, names[path])
            if element.tag in _NAMED_BY_FILE and attribute == "file" and not element.get("name"):
                element.set("name", PurePosixPath(name).stem)


def _add_placeholder(document: Document, mesh: ET.Element, files: Files, path: str) -> None:
    """Makes a mesh without a file a tetrahedron, and keeps the error of the file."""
    name = mesh.attrib.pop("file", path)
    try:
        files.read(path, f"the file of a <mesh> ({name!r})", limit=0)
    except InputError as error:
        document.missing[mesh.get("name") or PurePosixPath(name).stem] = str(error)
    mesh.set("name", mesh.get("name") or PurePosixPath(name).stem)
    mesh.set("vertex", _TETRAHEDRON)


def _pop_asset_folders(root: ET.Element) -> dict[str, str]:
    """Removes the asset folders of the compiler, and returns the folder per kind of asset."""
    folders: dict[str, str] = {}
    for compiler in root.iter("compiler"):
        default = compiler.attrib.pop("assetdir", None)
        for attribute, tags in _FOLDER_ATTRIBUTES.items():
            folder = compiler.attrib.pop(attribute, default)
            if folder is not None:
                folders |= dict.fromkeys(tags, folder)
        if compiler.attrib.pop("strippath", "false") == "true":
            _strip_paths(root)
    return folders


def _strip_paths(root: ET.Element) -> None:
    for element in root.iter():
        for attribute in [name for name in element.attrib if name.startswith("file")]:
            name = element.get(attribute, "").replace("\\", "/")
            element.set(attribute, PurePosixPath(name).name)


def plain_name(path: str, taken: Collection[str]) -> str:
    """Returns a unique name for an attachment of a log: no folders, no special characters."""
    name = _SPECIAL_CHARACTERS.sub("_", PurePosixPath(path).name).lstrip(".-") or "file"
    stem, dot, ending = name.rpartition(".")
    number = 2
    while name in taken:
        name = f"{stem}_{number}{dot}{ending}"
        number += 1
    return name
