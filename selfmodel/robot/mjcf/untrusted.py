"""The text and the files of an untrusted model: plain XML, and files of the robot's folders only.

A model may come from any source, and MuJoCo would read any file that it names. The memory and the
time of the model are limited by the child process that compiles it first.
"""

import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from posixpath import basename, expanduser, isdir, normpath, realpath
from xml.etree import ElementTree as ET  # _PlainTree refuses document types and deep trees

from selfmodel.errors import InputError
from selfmodel.files import read_file

MAX_TEXT = 2_000_000
"""Largest length of a model's text, characters: MuJoCo takes up to 200 bytes for each."""

MAX_FILE = 128 * 2**20
"""Largest size of a file that a model names, bytes."""

MAX_DEPTH = 200
"""Largest number of XML elements within each other."""

REFUSED_ELEMENTS: Mapping[str, str] = {
    "include": "reads another file",
    "attach": "reads another model",
    "model": "reads another model",
    "plugin": "runs other code",
    "extension": "runs other code",
}
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


def checked_model(mjcf: str, attached: Mapping[str, bytes]) -> tuple[str, dict[str, bytes]]:
    """Returns the model of a log and the attachments that it names, after all checks.

    The text is serialised from the checked elements: constructs that another parser might read
    differently, such as entities, are removed.

    Raises:
        InputError: The model is no XML, is nested too deeply, or names other files; the message
            contains the element.
    """
    if len(mjcf) > MAX_TEXT:
        raise InputError(f"the model has {len(mjcf)} characters, more than {MAX_TEXT}")
    root = parse_xml(mjcf)
    files = named_files(root, attached)
    return ET.tostring(root, encoding="unicode"), files


def named_files(root: ET.Element, attached: Mapping[str, bytes]) -> dict[str, bytes]:
    """Returns the files that a model names, after a check that a log can contain the model.

    Raises:
        InputError: The model is no MJCF, reads other models, runs other code, or names a file that
            is not attached, or is no asset.
    """
    if root.tag != "mujoco":
        raise InputError(f"expected a model in <mujoco>, got <{root.tag[:40]}>")
    files: dict[str, bytes] = {}
    folder = ""
    for element in root.iter():
        if effect := REFUSED_ELEMENTS.get(element.tag):
            named = element.get("file") or element.get("plugin") or element.get("name")
            raise InputError(
                f"the model has <{element.tag}>{f' ({named!r})' if named else ''}, which {effect}: "
                f"expected a model without <{element.tag}> in a log"
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
        root: Folder around all files of the robot; see ``root_around``.
        assets: Further folder with files that the MJCF names; "" for none.
    """

    path: Path
    root: Path
    assets: str = ""

    def has(self, name: str) -> bool:
        """Returns whether the file exists."""
        return self._find(name) is not None

    def read(self, name: str, what: str, limit: int) -> bytes:
        """Returns the content of a file, of at most ``limit`` bytes, by its path from the MJCF.

        Raises:
            InputError: The file is missing, a loop of links, outside the folders, or too large.
        """
        place = self._find(name)
        if place is not None:
            return read_file(place, what, limit)
        if _is_path(name) and self._may_read(realpath(self.path / name)):
            raise InputError(
                f"the MJCF names {what}, which is no file in {self.path}, or a loop of links: put "
                f"the file there, or {_REMEDY}"
            )
        raise InputError(
            f"the MJCF names {what} outside its own folder, {name!r}: put the file into "
            f"{self.root}, or {_REMEDY}"
        )

    def _find(self, name: str) -> Path | None:
        for place in self._places(name):
            with suppress(OSError):  # missing, a loop of links, or a name that is too long
                if self._may_read(realpath(place, strict=True)) and place.is_file():
                    return place
        return None

    def _places(self, name: str) -> Iterator[Path]:
        if not _is_path(name):
            return
        yield self.path / name
        if self.assets:
            parts = [part for part in PurePosixPath(name).parts if part not in ("..", "/", "//")]
            for start in range(len(parts)):
                yield Path(self.assets, *parts[start:])

    def _may_read(self, real: str) -> bool:
        folders = filter(None, (str(self.root), self.assets))
        return any(Path(real).is_relative_to(realpath(folder)) for folder in folders)


def _is_path(name: str) -> bool:
    return len(name) <= _MAX_NAME and "\0" not in name


def robot_folder(folder: Path, assets: str = "") -> Folder:
    """Returns the files of a robot whose MJCF or URDF is in a folder.

    Raises:
        InputError: The further folder ``assets`` is given and does not exist.
    """
    if assets and not isdir(assets):
        raise InputError(f"assets needs a folder with files of the robot, got {assets!r}")
    return Folder(folder, root_around(folder), assets)


def root_around(folder: Path) -> Path:
    """Returns the folder around the files of a robot whose MJCF or URDF is in a folder.

    It is the folder above if the layout is that of ROS and MuJoCo Menagerie: the folder has a name
    such as ``mjcf``, or there is a folder such as ``meshes`` beside it. It is never the home folder
    or a folder around that.
    """
    real = Path(realpath(folder))
    usual = real.name in _MODEL_FOLDERS or any(isdir(real.parent / name) for name in _ASSET_FOLDERS)
    return real.parent if usual and not is_around_home(real.parent) else folder


def is_around_home(folder: Path) -> bool:
    """Returns whether a folder is the home folder, or contains the home folder."""
    real, home = Path(realpath(folder)), Path(realpath(expanduser("~")))
    return real == real.parent or home.is_relative_to(real)


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
