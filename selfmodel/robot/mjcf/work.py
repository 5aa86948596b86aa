"""The MJCF that is being made a robot: its elements, its files, its settings, its model."""

import math
import re
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import PurePosixPath
from posixpath import basename, dirname, join, normpath, splitext
from xml.etree import ElementTree as ET  # of checked texts

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.errors import InputError
from selfmodel.robot.mjcf.settings import MjcfSettings
from selfmodel.robot.mjcf.untrusted import MAX_FILE, MAX_TEXT, Files, parse_xml
from selfmodel.robot.mujoco_errors import compile_model

_FOLDER_ATTRIBUTES = {"meshdir": ("mesh", "skin", "flex", "hfield"), "texturedir": ("texture",)}
_NAMED_BY_FILE = ("mesh", "texture", "hfield")
_ORIENTATIONS = ("quat", "axisangle", "xyaxes", "zaxis", "euler")
_TETRAHEDRON = "0 0 0 1 0 0 0 1 0 0 0 1"


@dataclass(eq=False)
class Work:
    """An MJCF that each step of the adaptation edits, and its model as it is at the moment.

    Attributes:
        assets: Contents of the files that the MJCF names, by names without folders.
        notes: Descriptions of the changes, one sentence each.
        missing: Error messages of the meshes without files, by name; they have placeholders.
    """

    root: ET.Element
    settings: MjcfSettings = field(default_factory=MjcfSettings)
    assets: dict[str, bytes] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    missing: dict[str, str] = field(default_factory=dict)
    _asset_names: dict[str, str] = field(default_factory=dict, init=False)
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

    def add_asset(self, files: Files, path: str, element: str) -> str:
        """Reads a file into the assets, once, and returns its name there.

        Raises:
            InputError: The file is missing, outside the folder, or too large with the others.
        """
        if path in self._asset_names:
            return self._asset_names[path]
        data = files.read(path, f"the file of a {element}", MAX_FILE)
        if sum(map(len, self.assets.values())) + len(data) > MAX_FILE:
            raise InputError(f"the files of the model have over {MAX_FILE} bytes: simplify them")
        # An attachment of a log: no folders, no special characters.
        plain = re.sub(r"[^A-Za-z0-9_.-]", "_", basename(path)).lstrip(".-") or "file"
        (stem, ending), name, number = splitext(plain), plain, 2
        while name in self.assets:
            name, number = f"{stem}_{number}{ending}", number + 1
        self.assets[name], self._asset_names[path] = data, name
        return name

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
        for body in range(model.nbody):
            parent = bodies[model.body(body).name] if body else self.children("worldbody")
            elements = (child for child in parent if child.tag == "geom")
            yield from enumerate(elements, int(model.body_geomadr[body]))

    def place_bodies(
        self,
        positions: FloatArray,
        orientations: FloatArray,
        references: Collection[tuple[int, float]] = (),
    ) -> None:
        """Writes the frames of bodies and references of joints that differ from the model's.

        They are ``(bodies, 3)`` m and ``(bodies, 4)``, w x y z, in the frames of the parents; and
        the reference of a joint by its id, m or rad.
        """
        model, elements = self.model, self.named_bodies()
        for body in range(1, model.nbody):
            element = elements[model.body(body).name]
            if not np.array_equal(positions[body], model.body_pos[body]):
                element.set("pos", format_numbers(positions[body]))
            if not np.array_equal(orientations[body], model.body_quat[body]):
                for attribute in _ORIENTATIONS:
                    element.attrib.pop(attribute, None)
                element.set("quat", format_numbers(orientations[body]))
        units = [c.get("angle") for c in self.root.iter("compiler") if c.get("angle")]
        radian = 1.0 if units[-1:] == ["radian"] else math.degrees(1.0)
        joints = {j.get("name"): j for body in elements.values() for j in body if j.tag == "joint"}
        for joint, reference in references:
            if reference != model.qpos0[model.jnt_qposadr[joint]]:
                slides = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE
                value = reference * (1.0 if slides else radian)
                joints[model.joint(joint).name].set("ref", repr(value))


class UniqueNames:
    """Unique names for the parts of one kind, given the names in use."""

    def __init__(self, names: Iterable[str | None]) -> None:
        self._names = set(names)
        self._numbers: dict[str, int] = {}

    def new(self, base: str) -> str:
        """Returns the base name, with a number appended if the name is in use."""
        name, number = base, self._numbers.get(base, 2)
        while name in self._names:
            name, number = f"{base}_{number}", number + 1
        self._names.add(name)
        self._numbers[base] = number
        return name


def format_numbers(values: np.ndarray) -> str:
    """Returns numbers as the text of an attribute, exact to the last bit."""
    # MuJoCo cannot read subnormal numbers.
    normal = np.where(np.abs(values) < np.finfo(np.float64).tiny, 0.0, values)
    return " ".join(repr(float(value)) for value in normal)


def read_mjcf(
    root: ET.Element, files: Files, settings: MjcfSettings | None = None, name: str = ""
) -> Work:
    """Returns the work on an MJCF, with includes inserted and all named files read.

    The root is changed in place. The MJCF is one of the files, by name, and cannot include itself.

    Raises:
        InputError: A file is missing, too large, outside the folder, or no MJCF.
    """
    if root.tag != "mujoco":
        raise InputError(f"expected an MJCF, which begins with <mujoco>, got <{root.tag[:40]}>")
    _include(root, files, "", {normpath(name)})
    work = Work(root, settings or MjcfSettings())
    _read_assets(work, files)
    if len(work.text) > MAX_TEXT:
        raise InputError(f"expected an MJCF of at most {MAX_TEXT} characters with its includes")
    return work


def _include(parent: ET.Element, files: Files, folder: str, included: set[str]) -> None:
    """Replaces each ``<include>`` by the content of its file, recursively, in place.

    ``folder`` is that of the file that contains ``parent``; ``included`` files are added.
    """
    for index, child in reversed(list(enumerate(parent))):
        if child.tag != "include":
            _include(child, files, folder, included)
            continue
        name = child.get("file", "")
        # MuJoCo's order: relative to the folder of the main file, then of the including file.
        path = normpath(name if files.has(name) else join(folder, name))
        data = files.read(path, f"a file to <include> ({name!r})", MAX_TEXT)
        if path in included:
            raise InputError(f"the MJCF includes {name!r} twice: name each file once")
        included.add(path)
        inner = parse_xml(data)
        _include(inner, files, dirname(path), included)
        parent[index : index + 1] = list(inner)


def _read_assets(work: Work, files: Files) -> None:
    """Reads the files that the MJCF names, and renames them to names without folders.

    A mesh without a file becomes a tetrahedron, and the error of its file is kept.
    """
    folders = _pop_asset_folders(work.root)
    for element in work.root.iter():
        for attribute, name in list(element.attrib.items()):
            if not attribute.startswith("file") or not name:
                continue
            path = str(PurePosixPath(folders.get(element.tag, ""), name))
            if element.tag in _NAMED_BY_FILE and attribute == "file" and not element.get("name"):
                element.set("name", PurePosixPath(name).stem)
            try:
                asset = work.add_asset(files, path, f"<{element.tag}> ({name!r})")
            except InputError as error:
                if element.tag != "mesh" or files.has(path):
                    raise
                work.missing[element.get("name", "")] = str(error)
                element.attrib.pop("file")
                element.set("vertex", _TETRAHEDRON)
            else:
                element.set(attribute, asset)


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
            for element in root.iter():
                for attribute in [name for name in element.attrib if name.startswith("file")]:
                    name = element.get(attribute, "").replace("\\", "/")
                    element.set(attribute, PurePosixPath(name).name)
    return folders
