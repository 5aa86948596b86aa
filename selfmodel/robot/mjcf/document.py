"""MJCF document: an MJCF without includes, the contents of the files that it names, its model."""

import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from pathlib import PurePosixPath
from posixpath import dirname, join, normpath
from xml.etree import ElementTree as ET  # of checked texts

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.errors import InputError
from selfmodel.robot.mjcf.files import Files
from selfmodel.robot.mjcf.untrusted import MAX_FILE, MAX_TEXT, parse_xml
from selfmodel.robot.mujoco_errors import compile_model

_FOLDER_ATTRIBUTES = {"meshdir": ("mesh", "skin", "flex", "hfield"), "texturedir": ("texture",)}
_NAMED_BY_FILE = ("mesh", "texture", "hfield")
_TETRAHEDRON = "0 0 0 1 0 0 0 1 0 0 0 1"
_SPECIAL_CHARACTERS = re.compile(r"[^A-Za-z0-9_.-]")


@dataclass(eq=False)
class Document:
    """An MJCF that is being adapted: its elements, and its model as it is at the moment.

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
    _compiled: tuple[str, mujoco.MjModel] | None = field(default=None, init=False)

    @property
    def model(self) -> mujoco.MjModel:
        """The compiled model, which is compiled again after a change of the text.

        Raises:
            InputError: MuJoCo cannot compile the MJCF.
        """
        text = self.text
        if self._compiled is None or self._compiled[0] != text:
            self._compiled = text, compile_model(text, self.assets)
        return self._compiled[1]

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

    def named_bodies(self) -> dict[str | None, ET.Element]:
        """Returns every ``<body>`` by its name."""
        return {body.get("name"): body for body in self.bodies()}

    def geoms(self) -> Iterator[tuple[int, ET.Element]]:
        """Yields the id in the model and the element of each geom; all bodies need a name."""
        model, bodies = self.model, self.named_bodies()
        worlds = [geom for world in self.root.findall("worldbody") for geom in world]
        for body in range(model.nbody):
            children = bodies[model.body(body).name] if body else worlds
            elements = (child for child in children if child.tag == "geom")
            yield from enumerate(elements, int(model.body_geomadr[body]))


def read_document(root: ET.Element, files: Files, name: str = "") -> Document:
    """Returns the document of an MJCF, with includes inserted and all named files read.

    Args:
        root: The root element of the MJCF; changed in place.
        files: Source of the files that the MJCF includes and names.
        name: Name of the MJCF among the files, which it cannot include.

    Raises:
        InputError: A file is missing, too large, outside the folder, or no MJCF.
    """
    if root.tag != "mujoco":
        raise InputError(f"expected an MJCF, which begins with <mujoco>, got <{root.tag[:40]}>")
    _include(root, files, "", {normpath(name)}, MAX_TEXT)
    document = Document(root)
    _read_assets(document, files, MAX_FILE)
    if len(document.text) > MAX_TEXT:
        raise InputError(f"expected an MJCF of at most {MAX_TEXT} characters with its includes")
    return document


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


_ORIENTATION_ATTRIBUTES = ("quat", "axisangle", "xyaxes", "zaxis", "euler")


@dataclass
class BodyFrames:
    """Frames of all bodies and references of joints, to be changed and written into a document.

    Attributes:
        position: Position of each body in its parent's frame, ``(bodies, 3)`` m.
        orientation: Orientation of each body in its parent's frame, ``(bodies, 4)``, w x y z.
        reference: New reference of joints by their ids, m or rad.
    """

    position: FloatArray
    orientation: FloatArray
    reference: dict[int, float] = field(default_factory=dict)

    @classmethod
    def of(cls, model: mujoco.MjModel) -> "BodyFrames":
        """Returns a copy of the frames of a model."""
        return cls(model.body_pos.copy(), model.body_quat.copy())

    def write(self, document: Document, model: mujoco.MjModel) -> None:
        """Writes the frames and references that differ from those of the compiled document."""
        elements = document.named_bodies()
        for body in range(1, model.nbody):
            element = elements[model.body(body).name]
            if not np.array_equal(self.position[body], model.body_pos[body]):
                element.set("pos", format_numbers(self.position[body]))
            if not np.array_equal(self.orientation[body], model.body_quat[body]):
                for attribute in _ORIENTATION_ATTRIBUTES:
                    element.attrib.pop(attribute, None)
                element.set("quat", format_numbers(self.orientation[body]))
        joints = {j.get("name"): j for body in elements.values() for j in body if j.tag == "joint"}
        for joint, reference in self.reference.items():
            if reference != model.qpos0[model.jnt_qposadr[joint]]:
                is_slide = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE
                unit = 1.0 if is_slide else document.angle_unit
                joints[model.joint(joint).name].set("ref", repr(reference * unit))


def format_numbers(values: np.ndarray) -> str:
    """Returns numbers as the text of an attribute, exact to the last bit."""
    # MuJoCo cannot read subnormal numbers.
    normal = np.where(np.abs(values) < np.finfo(np.float64).tiny, 0.0, values)
    return " ".join(repr(float(value)) for value in normal)
