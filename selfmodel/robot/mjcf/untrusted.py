"""Checks of an untrusted model before MuJoCo compiles the model: it names no other files.

A log may come from any source, and MuJoCo would read any file that the model names. The memory and
the time of the model are limited by the child process that compiles it first (``isolated_model``).
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from xml.etree import ElementTree as ET  # _Checker refuses document types and deep trees
from xml.parsers import expat  # the same

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
        ValueError: The model is no XML, is nested too deeply, or names other files; the message
            contains the element.
    """
    if len(mjcf) > MAX_TEXT:
        raise ValueError(f"the model has {len(mjcf)} characters, more than {MAX_TEXT}")
    checker = _Checker(attached)
    try:
        checker.check(mjcf)
        text = ET.tostring(ET.fromstring(mjcf), encoding="unicode")  # noqa: S314  # checked
    except (expat.ExpatError, ET.ParseError) as error:
        raise ValueError(f"the model is not XML: {error}") from error
    return CheckedModel(text, MappingProxyType(checker.files))


class _Checker:
    """Checks each element while the XML is parsed, before a tree is built."""

    def __init__(self, attached: Mapping[str, bytes]) -> None:
        self.files: dict[str, bytes] = {}
        self._attached = attached
        self._depth = 0
        self._folder = ""

    def check(self, mjcf: str) -> None:
        parser = expat.ParserCreate()
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.StartDoctypeDeclHandler = self._doctype
        parser.Parse(mjcf, True)
        if self._folder and self.files:
            raise ValueError(
                f"the model reads {next(iter(self.files))!r} in the folder {self._folder!r}: a "
                f"model in a log may name attached files only"
            )

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        if not self._depth and tag != "mujoco":
            raise ValueError(f"expected a model in <mujoco>, got <{tag}>")
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise ValueError(f"the model has more than {MAX_DEPTH} elements within each other")
        # <model> in <asset> reads a file; as the root element it is refused above.
        if tag in REFUSED_ELEMENTS:
            named = attributes.get("file") or attributes.get("plugin") or attributes.get("name")
            raise ValueError(
                f"the model has <{tag}>{f' ({named!r})' if named else ''}, which "
                f"{REFUSED_ELEMENTS[tag]}: expected a model without <{tag}> in a log"
            )
        for name, text in filter(lambda item: item[1], attributes.items()):
            self._attribute(tag, name, text)

    def _attribute(self, tag: str, name: str, text: str) -> None:
        if name.startswith("file"):
            self._file(tag, text)
        elif name in _FOLDER_ATTRIBUTES:
            self._folder = text
        elif name == "content_type":
            raise ValueError(
                f"the model's <{tag}> has the content type {text!r}: in a log, the ending of "
                f"a file's name must determine its type"
            )

    def _file(self, tag: str, name: str) -> None:
        if name not in self._attached or not _PLAIN_NAME.fullmatch(name):
            raise ValueError(
                f"the model's <{tag}> names the file {name!r}, which is not attached to the log"
            )
        if not name.lower().endswith(ASSET_ENDINGS):
            raise ValueError(
                f"the model names the file {name!r}: a model in a log may name "
                f"{', '.join(ASSET_ENDINGS)}"
            )
        self.files[name] = self._attached[name]

    def _end(self, _: str) -> None:
        self._depth -= 1

    def _doctype(self, *_: object) -> None:
        raise ValueError("the model has a <!DOCTYPE>, which is not allowed in a log")
