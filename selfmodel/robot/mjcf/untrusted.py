"""The text and the files of an untrusted model: plain XML, and files of the robot's folders only.

A model may come from any source, and MuJoCo would read any file that it names. The memory and the
time of the model are limited by the child process that compiles it first.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from errno import ELOOP
from os.path import realpath
from pathlib import Path, PurePosixPath
from posixpath import basename, normpath
from types import MappingProxyType
from xml.etree import ElementTree as ET  # _PlainTree refuses document types and deep trees

from selfmodel.errors import InputError
from selfmodel.files import read_file

MAX_TEXT = 2_000_000
"""Largest length of a model's text, characters: MuJoCo takes up to 200 bytes for each."""

MAX_FILE = 128 * 2**20
"""Largest size of a file that a model names, bytes."""

MAX_DEPTH = 200
"""Largest number of XML elements within each other."""

REFUSED_ELEMENTS: Mapping[str, str] = MappingProxyType(
    {
        "include": "reads another file",
        "attach": "reads another model",
        "model": "reads another model",
        "plugin": "runs other code",
        "extension": "runs other code",
    }
)
"""Elements that a model in a log may not have, and their effects."""

ASSET_ENDINGS = (".stl", ".obj", ".msh", ".png", ".ktx", ".skn", ".bin")
"""Endings of the files that a model in a log may name. No archives: MuJoCo would read another model
from an archive in place of a mesh, and the files of that model from any folder."""

_PLAIN_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*")
_FOLDER_ATTRIBUTES = ("meshdir", "texturedir", "assetdir")


def parse_xml(text: str | bytes) -> ET.Element:
    """Returns the root element of the text of a model.

    Raises:
        InputError: The text is no XML, has a document type, or is nested too deeply.
    """
    parser = ET.XMLParser(target=_PlainTree())  # noqa: S314  # which refuses what is unsafe
    try:
        parser.feed(text)
        root: ET.Element = parser.close()
    except InputError:
        raise
    except (ET.ParseError, LookupError, ValueError) as error:  # LookupError: unknown encoding
        raise InputError(f"expected an MJCF or URDF file, got no XML: {error}") from error
    return root


class _PlainTree(ET.TreeBuilder):
    """Refuses document types (and with them entities) and deep trees while they are parsed."""

    _depth = 0

    def doctype(self, *_: object) -> None:
        raise InputError("the model has a <!DOCTYPE>, which no model needs: remove the <!DOCTYPE>")

    def start(self, tag: str, attrs: dict[str, str]) -> ET.Element:
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise InputError(f"the model has more than {MAX_DEPTH} elements within each other")
        return super().start(tag, attrs)

    def end(self, tag: str) -> ET.Element:
        self._depth -= 1
        return super().end(tag)


@dataclass(frozen=True)
class CheckedModel:
    """A model that names attached files only.

    Attributes:
        mjcf: The MJCF, serialised from the checked elements: constructs that another parser might
            read differently, such as entities, are removed.
        files: Contents of the files that the model names, by name.
    """

    mjcf: str
    files: Mapping[str, bytes]


def checked_model(mjcf: str, attached: Mapping[str, bytes]) -> CheckedModel:
    """Returns the model of a log with the attachments that it names, after all checks.

    Raises:
        InputError: The model is no XML, is nested too deeply, or names other files; the message
            contains the element.
    """
    if len(mjcf) > MAX_TEXT:
        raise InputError(f"the model has {len(mjcf)} characters, more than {MAX_TEXT}")
    root = parse_xml(mjcf)
    files = named_files(root, attached)
    return CheckedModel(ET.tostring(root, encoding="unicode"), MappingProxyType(files))


def named_files(root: ET.Element, attached: Mapping[str, bytes]) -> dict[str, bytes]:
    """Returns the files that a model names, after a check that a log can contain the model.

    Args:
        root: The ``<mujoco>`` element.
        attached: Contents of files by name.

    Raises:
        InputError: The model is no MJCF, reads other models, runs other code, or names a file that
            is not attached, or is no asset.
    """
    if root.tag != "mujoco":
        raise InputError(f"expected a model in <mujoco>, got <{root.tag[:40]}>")
    files: dict[str, bytes] = {}
    folder = ""
    for element in root.iter():
        if element.tag in REFUSED_ELEMENTS:
            named = element.get("file") or element.get("plugin") or element.get("name")
            raise InputError(
                f"the model has <{element.tag}>{f' ({named!r})' if named else ''}, which "
                f"{REFUSED_ELEMENTS[element.tag]}: expected a model without <{element.tag}> in a "
                f"log"
            )
        for attribute, text in filter(lambda item: item[1], element.items()):
            if attribute.startswith("file"):
                _check_attached(element.tag, text, attached)
                files[text] = attached[text]
            elif attribute in _FOLDER_ATTRIBUTES:
                folder = text
            elif attribute == "content_type":
                raise InputError(
                    f"the model's <{element.tag}> has the content type {text!r}: in a log, the "
                    f"ending of a file's name must determine its type"
                )
    if folder and files:
        raise InputError(
            f"the model reads {next(iter(files))!r} in the folder {folder!r}: a model in a log may "
            f"name attached files only"
        )
    return files


def _check_attached(tag: str, name: str, attached: Mapping[str, bytes]) -> None:
    if name not in attached or not _PLAIN_NAME.fullmatch(name):
        raise InputError(
            f"the model's <{tag}> names the file {name!r}, which is not attached to the log"
        )
    if not name.lower().endswith(ASSET_ENDINGS):
        raise InputError(
            f"the model names the file {name!r}: a model in a log may name "
            f"{', '.join(ASSET_ENDINGS)}"
        )


_MODEL_FOLDERS = ("mjcf", "mjx", "mujoco", "scene", "scenes", "urdf", "xml", "xmls")
"""Names of folders in which a robot's package has its models."""

_ASSET_FOLDERS = ("assets", "meshes", "textures")
"""Names of folders in which a robot's package has its meshes and textures."""

_MAX_NAME = 4096
"""Largest path of a file, characters; Linux has the same limit."""

_REMEDY = "name a folder that contains the file, with --set assets=DIR"


@dataclass(frozen=True)
class Folder:
    """The files of a robot on disk.

    A file is read at its path from the folder of the MJCF, if that is within ``root`` or
    ``assets``. Otherwise its path is searched in ``assets``, first whole and then without its first
    folders: ``../../menagerie/go1/assets/trunk.stl`` is found as ``go1/assets/trunk.stl``,
    ``assets/trunk.stl`` or ``trunk.stl``. A link counts as the file that it leads to.

    Attributes:
        path: Folder of the MJCF.
        root: Folder around all files of the robot; see ``root_around``.
        assets: Further folder with files that the MJCF names; None for none.
    """

    path: Path
    root: Path
    assets: Path | None = None

    def has(self, name: str) -> bool:
        """Returns whether the file exists."""
        return self._find(name) is not None

    def read(self, name: str, what: str, limit: int) -> bytes:
        """Returns the content of a file.

        Args:
            name: Path of the file relative to the MJCF.
            what: Description of the file in an error message.
            limit: Largest size, bytes.

        Raises:
            InputError: The file is missing, a loop of links, outside the folders, or too large.
        """
        place = self._find(name)
        if place is not None:
            return read_file(place, what, limit)
        if any(map(_is_loop, self._places(name))):
            raise InputError(
                f"the MJCF names {what}, which is a loop of links: replace the link by the file"
            )
        if self._may_read(self.path / name):
            raise InputError(
                f"the MJCF names {what}, which is no file in {self.path}: put the file there, or "
                f"{_REMEDY}"
            )
        raise InputError(
            f"the MJCF names {what} outside its own folder, {name!r}: put the file into "
            f"{self.root}, or {_REMEDY}"
        )

    def _places(self, name: str) -> Iterator[Path]:
        if len(name) > _MAX_NAME:
            return
        yield self.path / name
        if self.assets is not None:
            parts = [part for part in PurePosixPath(name).parts if part not in ("..", "/", "//")]
            for start in range(len(parts)):
                yield self.assets.joinpath(*parts[start:])

    def _find(self, name: str) -> Path | None:
        return next(filter(self._is_file, self._places(name)), None)

    def _is_file(self, place: Path) -> bool:
        try:
            return self._may_read(place) and place.is_file()
        except OSError:  # a name that is too long for the file system
            return False

    def _may_read(self, place: Path) -> bool:
        folders = [folder for folder in (self.root, self.assets) if folder is not None]
        try:
            return any(_real(place).is_relative_to(_real(folder)) for folder in folders)
        except ValueError:  # a path with a zero byte
            return False


def _real(path: Path) -> Path:
    """Returns where a path leads to; a loop of links leads to itself (``resolve`` raises)."""
    return Path(realpath(path))


def _is_loop(place: Path) -> bool:
    try:
        place.stat()
    except OSError as error:
        return error.errno == ELOOP
    except ValueError:  # a path with a zero byte
        return False
    return False


def robot_folder(folder: Path, assets: str = "") -> Folder:
    """Returns the files of a robot whose MJCF or URDF is in a folder.

    Raises:
        InputError: The further folder ``assets`` is given and does not exist.
    """
    if assets and not _is_folder(assets):
        raise InputError(f"assets needs a folder with files of the robot, got {assets!r}")
    return Folder(folder, root_around(folder), Path(assets) if assets else None)


def _is_folder(path: str) -> bool:
    try:
        return Path(path).is_dir()
    except OSError:  # a name that is too long for the file system
        return False


def root_around(folder: Path) -> Path:
    """Returns the folder around the files of a robot whose MJCF or URDF is in a folder.

    It is the folder above if the layout is that of ROS and MuJoCo Menagerie: the folder has a name
    such as ``mjcf``, or there is a folder such as ``meshes`` beside it. It is never the home folder
    or a folder around that.
    """
    above = _real(folder).parent
    usual = _real(folder).name in _MODEL_FOLDERS or any(
        (above / name).is_dir() for name in _ASSET_FOLDERS
    )
    return above if usual and not is_around_home(above) else folder


def is_around_home(folder: Path) -> bool:
    """Returns whether a folder is the home folder, or contains the home folder."""
    try:
        home = Path.home()
    except RuntimeError:  # the user has no home folder
        return folder == folder.parent
    return folder == folder.parent or _real(home).is_relative_to(folder)


@dataclass(frozen=True)
class InMemory:
    """Files in memory, such as those of a dm_control domain, with the methods of ``Folder``."""

    files: Mapping[str, bytes | str]

    def has(self, name: str) -> bool:
        """Returns whether the file exists."""
        return self._content(name) is not None

    def read(self, name: str, what: str, limit: int) -> bytes:
        """Returns the content of a file; see ``Folder.read``."""
        content = self._content(name)
        if content is None:
            raise InputError(
                f"the MJCF names {what}, which is not given: pass the content of the file"
            )
        data = content.encode() if isinstance(content, str) else content
        if len(data) > limit:
            raise InputError(f"{name}: expected {what} of at most {limit} bytes, got more")
        return data

    def _content(self, name: str) -> bytes | str | None:
        plain = {normpath(path): content for path, content in self.files.items()}
        # MuJoCo also accepts a file in memory by its name without the folder.
        return plain.get(normpath(name), plain.get(basename(name)))


Files = Folder | InMemory
"""Source of the files that a model names, by their paths relative to the model."""
