"""Reading of a mapping, and its checks against robot and recording; each error names its line."""

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cached_property
from pathlib import Path
from typing import Any, get_args, get_origin, get_type_hints

import msgspec
from msgspec import Struct

from selfmodel.errors import InputError, listed, unknown_name
from selfmodel.files import load_toml, read_file
from selfmodel.logs.recordings.mapping import NONE, UNKNOWN, VECTORS, Angles, Keys, Place, Trial
from selfmodel.logs.recordings.messages import ARRAY, DECODERS, TYPES
from selfmodel.logs.recordings.recording import TABLE, Recording, Series
from selfmodel.robot.anatomy import Anatomy


@dataclass(frozen=True)
class RecordingMapping:
    """Mapping that was read: name of its file, its text, and its content, which is consistent."""

    name: str
    text: str
    trial: Trial

    @cached_property
    def places(self) -> dict[tuple[str, str], Place]:
        """Places by quantity and part; see ``Trial.places``."""
        return dict(self.trial.places())

    @property
    def topics(self) -> dict[str, set[str]]:
        """Columns by topic."""
        found: dict[str, set[str]] = {}
        for place in self.places.values():
            found.setdefault(place.topic, set()).update(place.columns)
        return found

    def error(self, path: Keys, sentence: str) -> InputError:
        """Returns an error that names the line of an entry, or that of its table."""
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
    """Returns the mapping in a text, which has a name in errors; see ``read_mapping``."""
    try:
        tables = load_toml(text)
    except ValueError as failure:
        raise _toml_error(name, text, str(failure)) from failure
    try:
        mapping = RecordingMapping(name, text, msgspec.convert(tables, Trial))
    except msgspec.ValidationError as failure:
        raise _error(name, text, *_explained(str(failure), tables)) from failure
    _check_keys(mapping, tables)
    _check_names(mapping, "joints", mapping.trial.joints)
    _check_names(mapping, "commands", mapping.trial.commands)
    return mapping


_OF_BAG: Mapping[str, Keys] = {
    "joints": ("topic",),
    "commands": ("topic", "order"),
    "base": ("topic",),
    "imu": ("topic",),
    "touch": ("topic", "index"),
}
"""Keys that a table of the file has in the mapping of a bag only."""


def _check_keys(mapping: RecordingMapping, tables: Mapping[str, Any]) -> None:
    """Checks that the keys are those of a table, whose mapping has ``[time]``, or of a bag."""
    trial, is_table = mapping.trial, mapping.trial.time is not None
    if not is_table:
        if "sensors" in tables:
            advice = "remove it, or add [time]"
            sentence = f"sensors is a key of the mapping of a table: {advice}"
            raise mapping.error(("sensors",), sentence)
        return
    sections: dict[Keys, Any] = {(role,): tables.get(role, {}) for role in _OF_BAG}
    sections |= {("touch", name): section for name, section in sections.pop(("touch",)).items()}
    unfit: list[Keys] = [("clock",)] if "clock" in tables else []
    for path, held in sections.items():
        unfit += [(*path, key) for key in _OF_BAG[path[0]] if key in held]
    for path in unfit:
        raise mapping.error(path, f"{path[-1]} is a key of the mapping of a bag: remove it")
    base = trial.base
    if base is not None and base.position is None and base.orientation is None:
        raise mapping.error(
            ("base",), "[base] needs position or orientation, and has neither: add one"
        )
    for name, touch in trial.touch.items():
        if not touch.column:
            raise mapping.error(("touch", name), f"[touch.{name}] needs column: add it")


def _check_names(mapping: RecordingMapping, role: str, angles: Angles) -> None:
    path = (role, "names")
    order = Counter[str](getattr(angles, "order", ()))
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


# ---------------------------------------------------------------- checks


def check_robot(mapping: RecordingMapping, anatomy: Anatomy) -> None:
    """Checks that a mapping names the parts of the robot and no others.

    All hinges must be mapped, some to ``NONE``, and all motors.
    """
    trial = mapping.trial
    touches = [sensor.name for sensor in anatomy.sensors if sensor.kind == "touch"]
    parts: dict[Keys, tuple[Iterable[str], str, Iterable[str]]] = {
        ("joints", "names"): (trial.joints.names, "hinge", anatomy.hinges),
        ("commands", "names"): (trial.commands.names, "motor", anatomy.motors),
        ("touch",): (trial.touch, "touch sensor", touches),
        ("joints", "velocities"): (trial.joints.velocities, "hinge", anatomy.hinges),
        ("joints", "efforts"): (trial.joints.efforts, "hinge", anatomy.hinges),
        ("sensors",): (trial.sensors, "sensor", anatomy.names.sensors),
    }
    for path, (mapped, what, known) in parts.items():
        for name in mapped:
            if name not in known:
                raise mapping.unknown((*path, name), f"{what} of the robot", name, known)
        if path[-1] == "names" and (missing := [name for name in known if name not in mapped]):
            advice = f", with {NONE!r} for a hinge without an encoder" if what == "hinge" else ""
            raise mapping.error(
                path,
                f"[{'.'.join(path)}] must list every {what} of the robot, and lacks "
                f"{', '.join(missing)}: add a line for each{advice}",
            )


def check_recording(mapping: RecordingMapping, recording: Recording) -> None:
    """Checks that a recording has what a mapping names, of a type that can play its role."""
    for place in mapping.places.values():
        _check_topic(mapping, recording, place)
    order = mapping.trial.commands.order
    for place in mapping.places.values():
        series = recording.series[place.topic]
        columns = series.names
        if place.role == ("commands",) and order:
            if len(order) != len(columns):
                raise mapping.error(
                    ("commands", "order"),
                    f"order must name the {len(columns)} numbers of a message on {place.topic}, "
                    f"got {len(order)} names",
                )
            continue
        for name in place.columns:
            if name and name not in columns:
                is_joint = place.role[0] in ("joints", "commands") and not series.by_place
                kind = "joint" if is_joint else "number"
                what = "column of the table" if place.topic == TABLE else f"{kind} on {place.topic}"
                near = get_close_matches(name, columns, 12, 0) if series.by_place else columns
                error = str(unknown_name(what, name, near))
                lost = f"; {NONE!r} is for a hinge without an encoder"
                raise mapping.error(place.path, error + (lost if place.role == ("joints",) else ""))


def _check_topic(mapping: RecordingMapping, recording: Recording, place: Place) -> None:
    role, topic = place.role, place.topic
    series = recording.series.get(topic)
    if topic == TABLE:
        if series is None:
            sentence = f"[{'.'.join(role)}] needs topic, or the mapping [time], of a table: add one"
            raise mapping.error(role, sentence)
        return
    path, kinds = (*role, "topic"), TYPES[role[0]]
    fitting = [name for name, one in recording.series.items() if one.type in kinds or one.by_place]
    if series is None:
        known = fitting or sorted(recording.series)
        raise mapping.unknown(path, "topic of the recording", topic, known)
    if not series.count:
        raise mapping.error(path, f"expected messages on {topic}, got none: name another one")
    if topic not in fitting:
        lost = ", which the bag does not define, or whose messages have no numbers that can be read"
        raise mapping.error(
            path,
            f"expected a topic of {' or '.join(kinds)} for {'.'.join(role)}, got {topic} of "
            f"{series.type or 'no type'}{'' if series.type in DECODERS else lost}: "
            f"name one that fits, of "
            f"{', '.join(fitting) or 'which the bag has none'}",
        )
    if series.by_place and place.columns == ("",):
        raise mapping.error(
            role,
            f"{topic} is of {series.type}, which has no role of its own: name its numbers under "
            f"{' or '.join(VECTORS.get(role[0], ('column',)))}, of {listed(series.names, 8)}",
        )
    path, key = place.path, place.path[len(role)]
    if (base := mapping.trial.base) and role == ("base",) and base.velocity_frame == "world":
        path, key = ("base", "velocity_frame"), "velocity_frame"
    if key not in ("names", "topic", "index") and not series.by_place:
        raise mapping.error(
            path,
            f"{key} is for a table, or a topic of a type without a role, got {topic} of "
            f"{series.type}: remove it",
        )
    _check_array(mapping, series, place)


def _check_array(mapping: RecordingMapping, series: Series, place: Place) -> None:
    """Checks that the numbers of a Float64MultiArray, and no others, are named by their place."""
    role, topic, trial = place.role, place.topic, mapping.trial
    if role[0] not in ("commands", "touch"):
        return
    key, table = (
        ("order", trial.commands) if role[0] == "commands" else ("index", trial.touch[role[1]])
    )
    named = getattr(table, key) not in (None, ())
    if series.type == ARRAY and not named:
        raise mapping.error(
            role,
            f"{topic} has numbers without names ({ARRAY}): add {key} to [{'.'.join(role)}], which "
            f"names them",
        )
    if named and series.type != ARRAY:
        raise mapping.error(
            (*role, key),
            f"{key} is for topics of {ARRAY}, got one of {series.type} on {topic}: remove it",
        )


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
    place = re.search(r" ?\(at line (\d+), column \d+\)", reason)
    line = int(place[1]) if place else max(1, text.count("\n"))
    reason = reason.replace(place[0] if place else "", "")
    shown = text.split("\n")[line - 1]
    entry = _ENTRY.match(shown) or _TABLE.match(shown)
    if entry and reason.startswith("Cannot "):  # overwrite, declare or mutate
        sentence = f"{entry[1]} is listed twice: remove one of the two, or merge them"
    else:
        sentence = f"expected TOML, got: {reason}: correct this line"
    return InputError(f"{name}:{line}: {sentence}")


_LONGEST_SHOWN = 100
_WORDS = {
    " | null": "",
    "`str | object`": '"a name in the recording" or { name = ... }',
    "`str`": "a text in quotes",
    "`float`": "a number",
    "`int`": "a whole number",
    "`object`": "a table",
    "`array`": "a list",
}


def _explained(message: str, tables: Mapping[str, Any]) -> tuple[Keys, str]:
    """Path and sentence of an error of msgspec, which does not name the keys of dictionaries."""
    sentence, _, place = message.partition(" - at `$")
    path: Keys = ()
    value: Any = tables
    kind: object = Trial
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
    expected = sentence.partition(", got")[0].removeprefix("Expected ")
    expected = re.sub(r" [<>] -?1000000000000000\.0", "", expected)  # neither infinite nor nan
    for type_, words in _WORDS.items():
        expected = expected.replace(type_, words)
    shown = repr(value)
    shown = shown if len(shown) <= _LONGEST_SHOWN else f"{shown[:_LONGEST_SHOWN]}..."
    return path, f"{path[-1]} must be {expected}, got {shown}: change it"


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
