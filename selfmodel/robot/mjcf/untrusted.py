"""Checks of the model of a log before MuJoCo compiles the model: no other files, bounded sizes.

A log may come from any source. MuJoCo would read any file that the model names, and one line of a
model can make a billion bodies.
"""

import re
from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from math import prod
from types import MappingProxyType
from xml.etree import ElementTree as ET  # _Checker refuses document types and large trees
from xml.parsers import expat  # the same

from selfmodel.robot.mjcf.asset_checks import pixel_count
from selfmodel.robot.mjcf.resource_limits import (
    ENTRIES_PER_UNIT,
    MAX_ARRAY_ENTRIES,
    MAX_ASSET_BYTES,
    MAX_COUNTS,
    MAX_DEPTH,
    MAX_ELEMENTS,
    MAX_MODEL_SIZE,
    MAX_USER_NUMBERS,
    MAX_VALUES,
    REFUSED_ELEMENTS,
)

_MUSCLE_ATTRIBUTES = ("gaintype", "biastype")
_MEMORY_SIZE = re.compile(r"-1|[0-9]{1,8}|[0-9]{1,5}[kK]|[0-9]{1,2}[mM]")  # below 100 MB
_PLAIN_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*")
_FOLDER_ATTRIBUTES = ("meshdir", "texturedir", "assetdir")


@dataclass(frozen=True)
class CheckedModel:
    """A model that names attached files only, and whose sizes are bounded.

    Attributes:
        mjcf: The MJCF, serialised from the checked elements: constructs that another parser might
            read differently, such as entities, are removed.
        files: Contents of the files that the model names, by name.
    """

    mjcf: str
    files: Mapping[str, bytes]


def checked_model(
    mjcf: str,
    attached: Mapping[str, bytes],
    *,
    allowed: Collection[str] = (),
    max_asset_bytes: int = MAX_ASSET_BYTES,
) -> CheckedModel:
    """Returns the model of a log after all checks.

    Args:
        mjcf: The MJCF in the log.
        attached: Contents of the attachments of the log, by name.
        allowed: Elements of ``REFUSED_ELEMENTS`` that the model may have nevertheless.
        max_asset_bytes: Largest sum of all files that the model names, counted once per mention.

    Raises:
        ValueError: The model is no XML, names other files, or exceeds a limit; the message
            contains the element.
    """
    if len(mjcf) > MAX_MODEL_SIZE:
        raise ValueError(f"the model has {len(mjcf)} characters, more than {MAX_MODEL_SIZE}")
    checker = _Checker(attached, allowed, max_asset_bytes)
    try:
        checker.check(mjcf)
        text = ET.tostring(ET.fromstring(mjcf), encoding="unicode")  # noqa: S314  # checked
    except (expat.ExpatError, ET.ParseError) as error:
        raise ValueError(f"the model is not XML: {error}") from error
    return CheckedModel(text, MappingProxyType(checker.files))


class _Checker:
    """Checks each element while the XML is parsed, before a tree is built."""

    def __init__(
        self, attached: Mapping[str, bytes], allowed: Collection[str], max_asset_bytes: int
    ) -> None:
        self.files: dict[str, bytes] = {}
        self._attached = attached
        self._allowed = allowed
        self._max_asset_bytes = max_asset_bytes
        self._path: list[str] = []
        self._counts: Counter[str] = Counter()
        self._elements = self._entries = self._bytes = 0
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
        if not self._path and tag != "mujoco":
            raise ValueError(f"expected a model in <mujoco>, got <{tag}>")
        # <model> in <asset> reads a file; as the root element it is refused above.
        if tag in REFUSED_ELEMENTS and tag not in self._allowed:
            named = attributes.get("file") or attributes.get("plugin") or attributes.get("name")
            raise ValueError(
                f"the model has <{tag}>{f' ({named!r})' if named else ''}, which "
                f"{REFUSED_ELEMENTS[tag]}: expected a model without <{tag}> in a log"
            )
        self._count("actuator" if self._path[-1:] == ["actuator"] else tag)
        for name, text in attributes.items():
            self._attribute(tag, name, text)
        self._add_entries(tag, attributes)
        self._path.append(tag)

    def _count(self, kind: str) -> None:
        self._elements += 1
        if self._elements > MAX_ELEMENTS or len(self._path) >= MAX_DEPTH:
            raise ValueError(
                f"the model has more than {MAX_ELEMENTS} elements, or {MAX_DEPTH} within each other"
            )
        self._counts[kind] += 1
        if self._counts[kind] > MAX_COUNTS.get(kind, MAX_ELEMENTS):
            raise ValueError(f"the model has more than {MAX_COUNTS[kind]} of <{kind}>")

    def _attribute(self, tag: str, name: str, text: str) -> None:
        if name.startswith("file") and text:
            self._file(tag, text)
        elif name in _FOLDER_ATTRIBUTES and text:
            self._folder = text
        elif name == "memory" and not _MEMORY_SIZE.fullmatch(text.strip()):
            raise ValueError(f"the model has memory={text!r}, expected less than 100 MB")
        elif name in MAX_VALUES or name.startswith("nuser_") or (tag, name) == ("numeric", "size"):
            _check_limit(tag, name, text, MAX_VALUES.get(name, 100 if name[0] == "n" else 10_000))
        else:
            _check_content(tag, name, text)

    def _file(self, tag: str, name: str) -> None:
        if name not in self._attached or not _PLAIN_NAME.fullmatch(name):
            raise ValueError(
                f"the model's <{tag}> names the file {name!r}, which is not attached to the log"
            )
        data = self._attached[name]
        if name not in self.files:
            self.files[name] = data
        # MuJoCo reads a file once per mention, into separate memory.
        self._bytes += len(data)
        if self._bytes > self._max_asset_bytes:
            raise ValueError(f"the model's files have more than {self._max_asset_bytes} bytes")
        self._add(pixel_count(name, data))

    def _add_entries(self, tag: str, attributes: Mapping[str, str]) -> None:
        sizes = {name: attributes[name] for name in ENTRIES_PER_UNIT if name in attributes}
        counts = [
            _largest(tag, name, text) * ENTRIES_PER_UNIT[name] for name, text in sizes.items()
        ]
        if not counts:
            return
        # Any number of elements may inherit a default.
        if "default" in self._path and max(counts) > 1:
            raise ValueError(
                f"the model's <default> gives <{tag}> the size {', '.join(sizes)}: in a log the "
                f"element itself must have it"
            )
        entries = prod(max(1, count) for count in counts)
        if tag == "texture":  # a cube map has six square faces
            entries = max(entries, 6 * _largest(tag, "width", sizes.get("width", "0")) ** 2)
        self._add(entries)

    def _add(self, entries: float) -> None:
        self._entries += int(entries)
        if self._entries > MAX_ARRAY_ENTRIES:
            raise ValueError(
                f"the model has more than {MAX_ARRAY_ENTRIES} pixels, heights and numbers in all"
            )

    def _end(self, _: str) -> None:
        self._path.pop()

    def _doctype(self, *_: object) -> None:
        raise ValueError("the model has a <!DOCTYPE>, which is not allowed in a log")


def _check_limit(tag: str, name: str, text: str, limit: float) -> None:
    if not _largest(tag, name, text) <= limit:
        raise ValueError(f"the model's <{tag}> has {name}={text!r}, expected at most {limit}")


def _largest(tag: str, name: str, text: str) -> float:
    try:
        return max((float(word) for word in text.split()), default=0)
    except ValueError:
        raise ValueError(f"the model's <{tag}> has {name}={text!r}, expected a number") from None


def _check_content(tag: str, name: str, text: str) -> None:
    if name == "content_type" and text:
        raise ValueError(
            f"the model's <{tag}> has the content type {text!r}: in a log, the ending of "
            f"a file's name must determine its type"
        )
    if (tag, name) == ("mesh", "builtin") and text.strip() != "none":
        raise ValueError(
            f"the model's <mesh> has builtin={text!r}, made of any number of points, which is not "
            f"allowed in a log"
        )
    if (tag, name) == ("rangefinder", "camera"):
        raise ValueError(
            "the model's <rangefinder> reads every pixel of a camera, which is not allowed in a log"
        )
    if name in _MUSCLE_ATTRIBUTES and text.strip() == "muscle":
        raise ValueError(
            f"the model's <{tag}> {REFUSED_ELEMENTS['muscle']}, which is not allowed in a log"
        )
    if name == "user" and len(text.split()) > MAX_USER_NUMBERS:
        raise ValueError(
            f"the model's <{tag}> has more than {MAX_USER_NUMBERS} numbers in {name!r}"
        )
