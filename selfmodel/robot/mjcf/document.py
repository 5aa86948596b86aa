"""An MJCF and the files that it names, as one document that stands alone."""

import re
from dataclasses import dataclass, field
from pathlib import PurePosixPath
from posixpath import dirname, join, normpath
from xml.etree import ElementTree as ET  # _guard refuses what makes it unsafe
from xml.parsers import expat  # the same

from selfmodel.errors import InputError
from selfmodel.robot.mjcf.files import Files
from selfmodel.robot.mjcf.untrusted import DEEPEST, LARGEST, MOST_ELEMENTS

LARGEST_READ = 64 * 2**20
"""Bytes of all files that a model names, before what is only seen is taken out of it."""

_FOLDERS = {"meshdir": ("mesh", "skin", "flex", "hfield"), "texturedir": ("texture",)}
_NAMED_BY_FILE = ("mesh", "texture", "hfield")
_UNUSUAL = re.compile(r"[^A-Za-z0-9_.-]")


@dataclass(eq=False)
class Document:
    """An MJCF that is being made ready.

    Attributes:
        root: Its ``<mujoco>``.
        assets: The files that it names, by plain names.
        notes: What was done to it, a sentence each.
    """

    root: ET.Element
    assets: dict[str, bytes] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    @property
    def text(self) -> str:
        """The MJCF."""
        return ET.tostring(self.root, encoding="unicode")

    @property
    def angle_unit(self) -> float:
        """Units in which it gives an angle of 1 rad."""
        units = [c.get("angle") for c in self.root.iter("compiler") if c.get("angle")]
        return 1.0 if units[-1:] == ["radian"] else 180.0 / 3.141592653589793

    def section(self, name: str) -> ET.Element:
        """Returns the first section of that name, made if there is none."""
        found = self.root.find(name)
        return ET.SubElement(self.root, name) if found is None else found

    def children(self, section: str) -> list[ET.Element]:
        """Returns what stands in all sections of that name, in order."""
        return [child for part in self.root.findall(section) for child in part]

    def bodies(self) -> list[ET.Element]:
        """Returns every ``<body>``, a parent before its children."""
        return [body for world in self.root.findall("worldbody") for body in world.iter("body")]


def read_document(mjcf: bytes, files: Files, name: str = "") -> Document:
    """Returns an MJCF with its includes in their places and its files in memory.

    Args:
        mjcf: The text.
        files: Where those that it names are looked for.
        name: Its own among them, which it cannot include.

    Raises:
        InputError: A file is missing, too large, out of bounds, or no MJCF.
    """
    if len(mjcf) > LARGEST:
        raise InputError(f"expected an MJCF of at most {LARGEST} bytes, got {len(mjcf)}")
    root = _parse(mjcf)
    if root.tag != "mujoco":
        raise InputError(_no_mjcf(root.tag))
    _include(root, files, "", {normpath(name)})
    if sum(1 for _ in root.iter()) > MOST_ELEMENTS:
        raise InputError(f"it has more than {MOST_ELEMENTS} elements: take out what does not move")
    document = Document(root)
    _gather(document, files)
    return document


def _no_mjcf(tag: str) -> str:
    if tag == "robot":
        return (
            "expected <mujoco>, got a URDF: save it as MJCF first, with "
            "mujoco.MjSpec.from_file(URDF).to_xml(), and give it a free joint and motors"
        )
    return f"expected an MJCF, which begins with <mujoco>, got <{tag[:40]}>"


def _parse(data: bytes) -> ET.Element:
    _guard(data)
    try:
        return ET.fromstring(data)  # noqa: S314  # guarded
    except (ET.ParseError, ValueError) as error:
        raise InputError(f"expected an MJCF file, got no XML: {error}") from error


def _guard(data: bytes) -> None:
    """Refuses entities, and elements within each other without end, before a tree is built."""
    depth = count = 0

    def start(_tag: str, _attributes: dict[str, str]) -> None:
        nonlocal depth, count
        depth += 1
        count += 1
        if depth > DEEPEST or count > MOST_ELEMENTS:
            raise InputError(
                f"it has more than {MOST_ELEMENTS} elements, or {DEEPEST} within each other"
            )

    def end(_tag: str) -> None:
        nonlocal depth
        depth -= 1

    def doctype(*_: object) -> None:
        raise InputError("it has a <!DOCTYPE>, which no MJCF needs: take it out")

    parser = expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(data, True)
    except (expat.ExpatError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"expected an MJCF file, got no XML: {error}") from error


def _include(parent: ET.Element, files: Files, here: str, included: set[str]) -> None:
    for place, child in reversed(list(enumerate(parent))):
        if child.tag != "include":
            _include(child, files, here, included)
            continue
        name = child.get("file", "")
        # As MuJoCo looks for it: from the main file's folder, then from that of this one.
        path = normpath(name if files.has(name) else join(here, name))
        data = files.read(path, f"a file to <include> ({name!r})", LARGEST)
        if path in included:
            raise InputError(f"it includes {name!r} twice: name each file once")
        included.add(path)
        inner = _parse(data)
        _include(inner, files, dirname(path), included)
        parent[place : place + 1] = list(inner)


def _gather(document: Document, files: Files) -> None:
    """Takes the files that are named into memory, under plain names."""
    folders = _asset_folders(document.root)
    taken: dict[str, str] = {}
    for element in document.root.iter():
        for attribute, name in list(element.attrib.items()):
            if not attribute.startswith("file") or not name:
                continue
            where = str(PurePosixPath(folders.get(element.tag, ""), name))
            if where not in taken:
                what = f"the file of a <{element.tag}> ({name!r})"
                data = files.read(where, what, LARGEST_READ)
                if sum(map(len, document.assets.values())) + len(data) > LARGEST_READ:
                    raise InputError(f"its files have over {LARGEST_READ} bytes: simplify them")
                taken[where] = _plain(where, document.assets)
                document.assets[taken[where]] = data
            element.set(attribute, taken[where])
            if element.tag in _NAMED_BY_FILE and attribute == "file" and not element.get("name"):
                element.set("name", PurePosixPath(name).stem)


def _asset_folders(root: ET.Element) -> dict[str, str]:
    """The folder of each kind of asset; the document keeps none of them."""
    folders: dict[str, str] = {}
    for compiler in root.iter("compiler"):
        both = compiler.attrib.pop("assetdir", None)
        for attribute, tags in _FOLDERS.items():
            named = compiler.attrib.pop(attribute, both)
            if named is not None:
                folders |= dict.fromkeys(tags, named)
        if compiler.attrib.pop("strippath", "false") == "true":
            _strip_paths(root)
    return folders


def _strip_paths(root: ET.Element) -> None:
    for element in root.iter():
        for attribute in [name for name in element.attrib if name.startswith("file")]:
            name = element.get(attribute, "").replace("\\", "/")
            element.set(attribute, PurePosixPath(name).name)


def _plain(where: str, taken: dict[str, bytes]) -> str:
    """A name for a file that a log can carry: no folders, no unusual letters."""
    name = _UNUSUAL.sub("_", PurePosixPath(where).name).lstrip(".-") or "file"
    stem, dot, ending = name.rpartition(".")
    number = 2
    while name in taken:
        name = f"{stem}_{number}{dot}{ending}"
        number += 1
    return name
