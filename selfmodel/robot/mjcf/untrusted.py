"""The text of an untrusted model, before MuJoCo compiles it: plain XML that names no other files.

A model may come from any source, and MuJoCo would read any file that it names. The memory and the
time of the model are limited by the child process that compiles it first.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from xml.etree import ElementTree as ET  # _PlainTree refuses document types and deep trees

from selfmodel.errors import InputError

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
"""Endings of the names of the files that a model in a log may name. Archives are excluded: MuJoCo
would read an archive in place of a mesh, and with the archive another model and the files of that
model from any folder."""

_PLAIN_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*")
_FOLDER_ATTRIBUTES = ("meshdir", "texturedir", "assetdir")


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
    """Returns the model of a log after all checks.

    Args:
        mjcf: The MJCF in the log.
        attached: Contents of the attachments of the log, by name.

    Raises:
        InputError: The model is no XML, is nested too deeply, or names other files; the message
            contains the element.
    """
    if len(mjcf) > MAX_TEXT:
        raise InputError(f"the model has {len(mjcf)} characters, more than {MAX_TEXT}")
    root = parse_xml(mjcf)
    files = named_files(root, attached)
    return CheckedModel(ET.tostring(root, encoding="unicode"), MappingProxyType(files))


def parse_xml(text: str | bytes) -> ET.Element:
    """Returns the root element of the text of a model.

    Raises:
        InputError: The text is no XML, has a document type, or is nested too deeply.
    """
    parser = ET.XMLParser(target=_PlainTree())  # noqa: S314  # which refuses what is unsafe
    try:
        parser.feed(text)
        root: ET.Element = parser.close()
    except (ET.ParseError, LookupError, ValueError) as error:  # LookupError: unknown encoding
        if isinstance(error, InputError):
            raise
        raise InputError(f"expected an MJCF or URDF file, got no XML: {error}") from error
    return root


class _PlainTree(ET.TreeBuilder):
    """Refuses document types (and with them entities) and deep trees while they are parsed."""

    _depth = 0

    def doctype(self, *_: object) -> None:
        """Refuses a document type."""
        raise InputError("the model has a <!DOCTYPE>, which no model needs: remove the <!DOCTYPE>")

    def start(self, tag: str, attrs: dict[str, str]) -> ET.Element:
        """Opens an element, if it is not too deep."""
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise InputError(f"the model has more than {MAX_DEPTH} elements within each other")
        return super().start(tag, attrs)

    def end(self, tag: str) -> ET.Element:
        """Closes an element."""
        self._depth -= 1
        return super().end(tag)


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
                files[text] = _attached(element.tag, text, attached)
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


def _attached(tag: str, name: str, attached: Mapping[str, bytes]) -> bytes:
    if name not in attached or not _PLAIN_NAME.fullmatch(name):
        raise InputError(
            f"the model's <{tag}> names the file {name!r}, which is not attached to the log"
        )
    if not name.lower().endswith(ASSET_ENDINGS):
        raise InputError(
            f"the model names the file {name!r}: a model in a log may name "
            f"{', '.join(ASSET_ENDINGS)}"
        )
    return attached[name]
