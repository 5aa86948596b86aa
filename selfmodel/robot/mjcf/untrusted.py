"""Checks a model that came with a log before MuJoCo sees it: no files, and no bombs.

A log may come from anybody. MuJoCo would read whatever file its model names, and a line of it can
ask for a billion bodies.
"""

import re
from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from math import prod
from types import MappingProxyType
from xml.etree import ElementTree as ET  # _Checker refuses what makes it unsafe
from xml.parsers import expat  # the same

from selfmodel.robot.mjcf.asset_checks import cells_of

LARGEST = 2 * 2**20
"""Characters of text that a model may have: ours have under 10,000. Points that stand in it take
six each, and MuJoCo some ten seconds for the hull of a million."""
LARGEST_FILES = 4 * 2**20
"""Bytes of all files that a model names, each as often as it is named; for the same reason."""
MOST_ELEMENTS = 20_000
DEEPEST = 200
MOST_CELLS = 2**23
"""Pixels, heights and numbers that a model may ask for by their count, all together."""

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
        "muscle": "is simulated, for any time, while the model is loaded",
        "lengthrange": "has actuators simulated, for any time, while the model is loaded",
    }
)
"""Elements that a model in a log may not have, and what they do."""

MOST: Mapping[str, int] = MappingProxyType(
    {"joint": 1000, "freejoint": 1000, "actuator": 1000, "key": 100}
)
"""How many there may be of what takes memory or time with the square of its number."""

LIMITS: Mapping[str, float] = MappingProxyType(
    {
        **dict.fromkeys(("width", "height", "nrow", "ncol"), 8192),
        **dict.fromkeys(("dim", "num", "nsample", "maxhullvert", "njmax", "nconmax"), 10_000),
        **dict.fromkeys(("nuserdata", "nstack"), 10**6),
        **dict.fromkeys(("nkey", "actdim", "cellcount"), 100),
        **dict.fromkeys(("offwidth", "offheight", "shadowsize"), 16_384),
        **dict.fromkeys(("numslices", "numstacks", "numquads", "offsamples"), 1000),
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

WEIGHTS: Mapping[str, int] = MappingProxyType(
    {
        **dict.fromkeys(("width", "height", "nrow", "ncol", "dim", "actdim", "nuserdata"), 1),
        "num": 32,  # numbers that are told of one contact
        "nsample": 64,  # numbers of one reading, of those that are many
    }
)
"""Those that count towards ``MOST_CELLS``: what an element asks for is the product of them."""

_MUSCLE = ("gaintype", "biastype")
_MOST_USER = 100  # numbers of "user"; MuJoCo gives every element as many as the longest has
_MEMORY = re.compile(r"-1|[0-9]{1,8}|[0-9]{1,5}[kK]|[0-9]{1,2}[mM]")  # below 100 MB
_PLAIN = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*")
_FOLDERS = ("meshdir", "texturedir", "assetdir")


@dataclass(frozen=True)
class CheckedModel:
    """A model that asks for no files but those attached, and for bounded sizes.

    Attributes:
        mjcf: Its text, written anew from what was checked: what another parser might read
            differently, such as entities, is not in it.
        files: The files that it names.
    """

    mjcf: str
    files: Mapping[str, bytes]


def checked_model(
    mjcf: str,
    attached: Mapping[str, bytes],
    *,
    allowed: Collection[str] = (),
    largest_files: int = LARGEST_FILES,
) -> CheckedModel:
    """Returns a model once nothing in it asks for what a model in a log may not have.

    Args:
        mjcf: The model, as it stands in a log.
        attached: The files that came with it.
        allowed: Elements of ``REFUSED`` that it may have all the same.
        largest_files: Bytes that the files may have which it names, each as often as it does.

    Raises:
        ValueError: It asks for more; the sentence names what.
    """
    if len(mjcf) > LARGEST:
        raise ValueError(f"the model has {len(mjcf)} characters, more than {LARGEST}")
    checker = _Checker(attached, allowed, largest_files)
    try:
        checker.check(mjcf)
        text = ET.tostring(ET.fromstring(mjcf), encoding="unicode")  # noqa: S314  # checked
    except (expat.ExpatError, ET.ParseError) as error:
        raise ValueError(f"the model is not XML: {error}") from error
    return CheckedModel(text, MappingProxyType(checker.files))


class _Checker:
    """Looks at each element as it is parsed, so that nothing large is ever built."""

    def __init__(
        self, attached: Mapping[str, bytes], allowed: Collection[str], largest_files: int
    ) -> None:
        self.files: dict[str, bytes] = {}
        self._attached = attached
        self._allowed = allowed
        self._largest_files = largest_files
        self._within: list[str] = []
        self._counts: Counter[str] = Counter()
        self._elements = self._cells = self._bytes = 0
        self._folder = ""

    def check(self, mjcf: str) -> None:
        parser = expat.ParserCreate()
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.StartDoctypeDeclHandler = self._doctype
        parser.Parse(mjcf, True)
        if self._folder and self.files:
            raise ValueError(
                f"the model looks for {next(iter(self.files))!r} in the folder {self._folder!r}: a "
                f"model in a log may name attached files only"
            )

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        if not self._within and tag != "mujoco":
            raise ValueError(f"expected a model in <mujoco>, got <{tag}>")
        # <model> within <asset> reads a file; at the top it would be no MJCF.
        if tag in REFUSED and tag not in self._allowed:
            named = attributes.get("file") or attributes.get("plugin") or attributes.get("name")
            raise ValueError(
                f"the model has <{tag}>{f' ({named!r})' if named else ''}, which "
                f"{REFUSED[tag]}: a model in a log may not"
            )
        self._count("actuator" if self._within[-1:] == ["actuator"] else tag)
        for name, text in attributes.items():
            self._attribute(tag, name, text)
        self._weigh(tag, attributes)
        self._within.append(tag)

    def _count(self, kind: str) -> None:
        self._elements += 1
        if self._elements > MOST_ELEMENTS or len(self._within) >= DEEPEST:
            raise ValueError(
                f"the model has more than {MOST_ELEMENTS} elements, or {DEEPEST} within each other"
            )
        self._counts[kind] += 1
        if self._counts[kind] > MOST.get(kind, MOST_ELEMENTS):
            raise ValueError(f"the model has more than {MOST[kind]} of <{kind}>")

    def _attribute(self, tag: str, name: str, text: str) -> None:
        if name.startswith("file") and text:
            self._file(tag, text)
        elif name in _FOLDERS and text:
            self._folder = text
        elif name == "memory" and not _MEMORY.fullmatch(text.strip()):
            raise ValueError(f"the model asks for {text!r} of memory, expected less than 100 MB")
        elif name in LIMITS or name.startswith("nuser_") or (tag, name) == ("numeric", "size"):
            _check_limit(tag, name, text, LIMITS.get(name, 100 if name[0] == "n" else 10_000))
        else:
            _check_meaning(tag, name, text)

    def _file(self, tag: str, name: str) -> None:
        if name not in self._attached or not _PLAIN.fullmatch(name):
            raise ValueError(
                f"the model's <{tag}> names the file {name!r}, which is not attached to the log"
            )
        data = self._attached[name]
        if name not in self.files:
            self.files[name] = data
        # Each mention is read again, and takes its memory again.
        self._bytes += len(data)
        if self._bytes > self._largest_files:
            raise ValueError(f"the model's files have more than {self._largest_files} bytes")
        self._add(cells_of(name, data))

    def _weigh(self, tag: str, attributes: Mapping[str, str]) -> None:
        sizes = {name: attributes[name] for name in WEIGHTS if name in attributes}
        counts = [_largest(tag, name, text) * WEIGHTS[name] for name, text in sizes.items()]
        if not counts:
            return
        # Any number of elements may take over what stands there.
        if "default" in self._within and max(counts) > 1:
            raise ValueError(
                f"the model's <default> gives <{tag}> the size {', '.join(sizes)}: in a log the "
                f"element itself must have it"
            )
        cells = prod(max(1, count) for count in counts)
        if tag == "texture":  # a cube has six squares
            cells = max(cells, 6 * _largest(tag, "width", sizes.get("width", "0")) ** 2)
        self._add(cells)

    def _add(self, cells: float) -> None:
        self._cells += int(cells)
        if self._cells > MOST_CELLS:
            raise ValueError(
                f"the model asks for more than {MOST_CELLS} pixels, heights and numbers in all"
            )

    def _end(self, _: str) -> None:
        self._within.pop()

    def _doctype(self, *_: object) -> None:
        raise ValueError("the model has a <!DOCTYPE>: a model in a log may not")


def _check_limit(tag: str, name: str, text: str, limit: float) -> None:
    if not _largest(tag, name, text) <= limit:
        raise ValueError(f"the model's <{tag}> asks for {name}={text!r}, expected at most {limit}")


def _largest(tag: str, name: str, text: str) -> float:
    try:
        return max((float(word) for word in text.split()), default=0)
    except ValueError:
        raise ValueError(f"the model's <{tag}> has {name}={text!r}, expected a number") from None


def _check_meaning(tag: str, name: str, text: str) -> None:
    if name == "content_type" and text:
        raise ValueError(
            f"the model's <{tag}> has the content type {text!r}: in a log a file's "
            f"name says what it is"
        )
    if (tag, name) == ("mesh", "builtin") and text.strip() != "none":
        raise ValueError(
            f"the model's <mesh> is {text!r}, made of any number of points: a model "
            f"in a log may not"
        )
    if (tag, name) == ("rangefinder", "camera"):
        raise ValueError(
            "the model's <rangefinder> reads every pixel of a camera: a model in a log may not"
        )
    if name in _MUSCLE and text.strip() == "muscle":
        raise ValueError(f"the model's <{tag}> {REFUSED['muscle']}: a model in a log may not")
    if name == "user" and len(text.split()) > _MOST_USER:
        raise ValueError(f"the model's <{tag}> has more than {_MOST_USER} numbers in {name!r}")
