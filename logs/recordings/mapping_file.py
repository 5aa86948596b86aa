"""Reading of a mapping; each error names its line."""

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, get_args, get_origin, get_type_hints

import msgspec
from msgspec import Struct

from selfmodel.errors import InputError, unknown_name
from selfmodel.files import load_toml, read_file
from selfmodel.logs.recordings.mapping import NONE, UNKNOWN, BagMapping, Keys, Place, TableMapping


@dataclass(frozen=True)
class RecordingMapping:
    """Mapping that was read, checked for internal consistency.

    Attributes:
        name: Name of the file in errors.
        text: Its text.
        trial: Its content.
    """

    name: str
    text: str
    trial: BagMapping | TableMapping

    @cached_property
    def places(self) -> dict[tuple[str, str], Place]:
        """Places by quantity and part; see ``Places``."""
        return dict(self.trial.places())

    def error(self, path: Keys, sentence: str) -> InputError:
        """Returns an error that names the line of an entry.

        Args:
            path: Path of the entry; for an entry without its own line, the line of its table.
            sentence: Expected value, given value, and remedy.
        """
        return _error(self.name, self.text, path, sentence)

    def unknown(self, path: Keys, what: str, name: str, known: Iterable[str]) -> InputError:
        """Returns the error for a name that is not in ``known``; see ``error``."""
        return self.error(path, str(unknown_name(what, name, known)))


def read_mapping(path: Path) -> RecordingMapping:
    """Returns the mapping in a file.

    Raises:
        InputError: The file cannot be read, or is invalid; the message names the line.
    """
    try:
        text = read_file(path, "a mapping", 2**20).decode()
    except UnicodeDecodeError as failure:
        raise InputError(f"{path}: expected TOML in UTF-8, got: {failure.reason}") from failure
    return parse_mapping(text, path.name)


def parse_mapping(text: str, name: str) -> RecordingMapping:
    """Returns the mapping in a text; see ``read_mapping``.

    Args:
        text: Text, as TOML.
        name: Name of the text in errors.
    """
    try:
        tables = load_toml(text)
    except ValueError as failure:
        raise _toml_error(name, text, str(failure)) from failure
    joints = tables.get("joints")
    if "time" not in tables and isinstance(joints, dict) and "topic" not in joints:
        sentence = "[joints] needs topic, for a bag, or the mapping [time], for a table: add one"
        raise _error(name, text, ("joints",), sentence)
    kind: type[BagMapping | TableMapping] = TableMapping if "time" in tables else BagMapping
    try:
        mapping = RecordingMapping(name, text, msgspec.convert(tables, kind))
    except msgspec.ValidationError as failure:
        raise _error(name, text, *_explained(str(failure), tables, kind)) from failure
    _check_names(mapping, "joints")
    _check_names(mapping, "commands")
    return mapping


def _check_names(mapping: RecordingMapping, role: Literal["joints", "commands"]) -> None:
    """Checks that each name in the recording is filled in, and used once."""
    angles = getattr(mapping.trial, role)
    path = (role, "names")
    order = Counter(getattr(angles, "order", ()))
    if twice := [column for column, count in order.items() if count > 1]:
        raise mapping.error((role, "order"), f"{twice[0]} is listed twice in order: remove one")
    absent = [part for part in angles.names if part not in angles.links]
    if absent and role == "commands":
        raise mapping.error(
            (*path, absent[0]),
            f"{absent[0]} must have a command, got {NONE!r}, which is for hinges without an "
            f"encoder: fill in its name",
        )
    if absent and not angles.links:
        raise mapping.error(
            path, f"expected the name of one joint or more, got {NONE!r} for all: fill it in"
        )
    parts: dict[str, str] = {}
    for part, link in angles.links.items():
        if link.name == UNKNOWN:
            raise mapping.error(
                (*path, part), f"{part} is still {UNKNOWN!r}: fill in its name in the recording"
            )
        if link.name in parts:
            raise mapping.error(
                (*path, part),
                f"{link.name} is listed twice, for {parts[link.name]} and for {part}: expected "
                f"each joint of the recording once",
            )
        parts[link.name] = part
        if order and link.name not in order:
            raise mapping.unknown((*path, part), "name in order", link.name, order)


# ---------------------------------------------------------------- errors

_KEY = r"""(?:[A-Za-z0-9_-]+|"(?:[^"\\]|\\.)*"|'[^']*')"""
_KEYS = rf"{_KEY}(?:\s*\.\s*{_KEY})*"
_TABLE = re.compile(rf"\s*\[\s*({_KEYS})\s*\]")
_ENTRY = re.compile(rf"\s*({_KEYS})\s*=")


def _error(name: str, text: str, path: Keys, sentence: str) -> InputError:
    lines: dict[Keys, int] = {(): 1}
    table: Keys = ()
    for number, line in enumerate(text.split("\n"), start=1):  # TOML has no other line end
        if header := _TABLE.match(line):
            table = _names(header[1])
            lines.setdefault(table, number)
        elif entry := _ENTRY.match(line):
            names = (*table, *_names(entry[1]))
            for end in range(len(table) + 1, len(names) + 1):
                lines.setdefault(names[:end], number)
    known = next(path[:n] for n in range(len(path), -1, -1) if path[:n] in lines)
    return InputError(f"{name}:{lines[known]}: {sentence}")


def _names(keys: str) -> Keys:
    return tuple(key.strip("\"'") for key in re.findall(_KEY, keys))


def _toml_error(name: str, text: str, reason: str) -> InputError:
    found = re.search(r" ?\(at line (\d+), column \d+\)", reason)
    line = int(found[1]) if found else max(1, text.count("\n"))
    reason = reason.replace(found[0] if found else "", "")
    entry = _ENTRY.match(text.split("\n")[line - 1])
    if reason == "Cannot overwrite a value" and entry:
        reason = f"{entry[1]} is listed twice: expected each name once, remove one of the two"
    elif reason.startswith(("Cannot declare", "Cannot mutate")):
        reason = f"this table is listed twice ({reason}): merge its entries"
    else:
        reason = f"expected TOML: {reason}"
    return InputError(f"{name}:{line}: {reason}")


def _explained(message: str, tables: Mapping[str, Any], kind: object) -> tuple[Keys, str]:
    """Path and sentence of an error of msgspec, which does not name the keys of dictionaries."""
    sentence, _, place = message.partition(" - at `$")
    path: Keys = ()
    value: Any = tables
    for key, _anything in re.findall(r"\.(\w+)|(\[\.\.\.\])", place):
        if key:
            kind, name = get_type_hints(_arm(kind), include_extras=True)[key], key
        else:
            kind = get_args(_arm(kind))[1]
            name = next(name for name, item in value.items() if not _fits(item, kind))
        path, value = (*path, name), value[name]
    where = f"[{'.'.join(path)}]" if path else "the mapping"
    quoted = re.search(r"`(\w+)`$", sentence)
    if sentence.startswith("Object contains unknown field") and quoted:
        known = _arm(kind).__struct_fields__
        return (*path, quoted[1]), str(unknown_name(f"key of {where}", quoted[1], known))
    if sentence.startswith("Object missing required field") and quoted:
        return path, f"{where} needs {quoted[1]}, and has none: add it"
    if sentence.startswith("Invalid enum value"):
        return path, str(unknown_name(path[-1], str(value), get_args(kind)))
    if not sentence.startswith("Expected"):
        return path, sentence
    expected = sentence.partition(", got")[0].removeprefix("Expected ").replace(" | null", "")
    expected = re.sub(r" [<>] -?1000000000000000\.0", "", expected)  # neither infinite nor nan
    for type_, words in _WORDS.items():
        expected = expected.replace(type_, words)
    shown = repr(value)
    shown = shown if len(shown) <= _LONGEST_SHOWN else f"{shown[:_LONGEST_SHOWN]}..."
    return path, f"{path[-1]} must be {expected}, got {shown}: change it"


_LONGEST_SHOWN = 100
_WORDS = {
    "`str | object`": '"a name in the recording" or { name = ... }',
    "`str`": "a text in quotes",
    "`float`": "a number",
    "`int`": "a whole number",
    "`object`": "a table",
    "`array`": "a list",
}


def _fits(value: object, kind: object) -> bool:
    try:
        msgspec.convert(value, type=kind)
    except msgspec.ValidationError:
        return False
    return True


def _arm(kind: object) -> Any:  # noqa: ANN401  # an annotation
    """Table or dictionary in a type that may be optional."""
    arms = get_args(kind) if get_origin(kind) is not dict and get_args(kind) else (kind,)
    return next(
        arm
        for arm in arms
        if get_origin(arm) is dict or (isinstance(arm, type) and issubclass(arm, Struct))
    )
