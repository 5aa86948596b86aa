"""Checks a model that came with a log before MuJoCo sees it: no files, and no bombs.

A log may come from anybody. MuJoCo would read whatever file its model names, and a line of it can
ask for a billion bodies.
"""

import re
from collections.abc import Collection, Mapping
from types import MappingProxyType
from xml.etree import ElementTree as ET  # _Checker refuses what makes it unsafe
from xml.parsers import expat  # the same

LARGEST = 8 * 2**20
"""Bytes of text that a model may have: ours have under 10 kB."""
MOST_ELEMENTS = 20_000
DEEPEST = 200

REFUSED: Mapping[str, str] = MappingProxyType(
    {
        "include": "reads another file",
        "attach": "reads another model",
        "model": "reads another model",
        "plugin": "runs other code",
        "extension": "runs other code",
        "replicate": "makes any number of bodies",
        "composite": "makes any number of bodies",
        "flexcomp": "makes any number of bodies",
    }
)
"""Elements that a model in a log may not have, and what they do."""

LIMITS: Mapping[str, float] = MappingProxyType(
    {
        **dict.fromkeys(("width", "height", "nrow", "ncol"), 4096),
        **dict.fromkeys(("dim", "num", "nsample", "maxhullvert"), 10_000),
        **dict.fromkeys(("njmax", "nconmax", "nuserdata", "nkey", "nstack"), 10**6),
        **dict.fromkeys(
            (
                *("iterations", "ls_iterations", "noslip_iterations", "ccd_iterations"),
                *("sdf_iterations", "sdf_initpoints"),
            ),
            10_000,
        ),
    }
)
"""The largest values of attributes by which a model asks for memory or time."""

_MEMORY = re.compile(r"-1|\d{1,8}[kK]?|\d{1,2}[mM]")  # below 100 MB
_PLAIN = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*")
_FOLDERS = ("meshdir", "texturedir", "assetdir")


def checked_mjcf(mjcf: str, attached: Collection[str]) -> str:
    """Returns a model as text that asks for no files but those attached, and for bounded sizes.

    The text is written anew from what was checked: what another parser might read differently,
    such as entities, is not in it.

    Args:
        mjcf: The model, as it stands in a log.
        attached: Names of the files that came with it.

    Raises:
        ValueError: It asks for more; the sentence names what.
    """
    if len(mjcf) > LARGEST:
        raise ValueError(f"the model has {len(mjcf)} characters, more than {LARGEST}")
    checker = _Checker(attached)
    try:
        checker.check(mjcf)
        return ET.tostring(ET.fromstring(mjcf), encoding="unicode")  # noqa: S314  # checked
    except (expat.ExpatError, ET.ParseError) as error:
        raise ValueError(f"the model is not XML: {error}") from error


class _Checker:
    """Looks at each element as it is parsed, so that nothing large is ever built."""

    def __init__(self, attached: Collection[str]) -> None:
        self._attached = attached
        self._elements = self._depth = 0
        self._folder = self._file = ""

    def check(self, mjcf: str) -> None:
        parser = expat.ParserCreate()
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.StartDoctypeDeclHandler = self._doctype
        parser.Parse(mjcf, True)
        if self._folder and self._file:
            raise ValueError(
                f"the model looks for {self._file!r} in the folder {self._folder!r}: a model in a "
                f"log may name attached files only"
            )

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        self._elements, self._depth = self._elements + 1, self._depth + 1
        if self._elements > MOST_ELEMENTS or self._depth > DEEPEST:
            raise ValueError(
                f"the model has more than {MOST_ELEMENTS} elements, or {DEEPEST} within each other"
            )
        # <model> within <asset> reads a file; at the top it would be no MJCF.
        if tag in REFUSED:
            named = attributes.get("file") or attributes.get("plugin") or attributes.get("name")
            raise ValueError(
                f"the model has <{tag}>{f' ({named!r})' if named else ''}, which "
                f"{REFUSED[tag]}: a model in a log may not"
            )
        for name, text in attributes.items():
            self._attribute(tag, name, text)

    def _attribute(self, tag: str, name: str, text: str) -> None:
        if name.startswith("file") and text:
            self._file = text
            if text not in self._attached or not _PLAIN.fullmatch(text):
                raise ValueError(
                    f"the model's <{tag}> names the file {text!r}, which is not attached to the log"
                )
        elif name in _FOLDERS and text:
            self._folder = text
        elif name == "memory" and not _MEMORY.fullmatch(text.strip()):
            raise ValueError(f"the model asks for {text!r} of memory, expected less than 100 MB")
        elif name in LIMITS or name.startswith("nuser_") or (tag, name) == ("numeric", "size"):
            _check_limit(tag, name, text, LIMITS.get(name, 10_000))

    def _end(self, _: str) -> None:
        self._depth -= 1

    def _doctype(self, *_: object) -> None:
        raise ValueError("the model has a <!DOCTYPE>: a model in a log may not")


def _check_limit(tag: str, name: str, text: str, limit: float) -> None:
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        return  # a word, of another meaning; MuJoCo says so if it has none
    if any(not value <= limit for value in values):
        raise ValueError(f"the model's <{tag}> asks for {name}={text!r}, expected at most {limit}")
