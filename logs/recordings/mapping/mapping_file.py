"""Strict reader of mapping files: an entry without effect is an error."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Literal

from selfmodel.errors import InputError
from selfmodel.files import read_file
from selfmodel.logs.recordings.mapping.mapping import (
    ANGLES,
    CLOCKS,
    COLUMN_CLOCK,
    COMMAND_UNITS,
    FORCES,
    FRAMES,
    LENGTHS,
    NONE,
    TABLE,
    TIMES,
    UNKNOWN,
    VECTORS,
    VELOCITY_FRAMES,
    Angles,
    Base,
    Inertial,
    Link,
    RecordingMapping,
    TimeColumn,
    Touch,
)
from selfmodel.logs.recordings.mapping.strict_toml import Table, parse_document, shortened
from selfmodel.trials.trial import STAGES

MAX_MAPPING_BYTES = 2**20
"""Maximum size of a mapping, bytes."""


def read_mapping(path: Path) -> RecordingMapping:
    """Returns the mapping in a file.

    Raises:
        InputError: The file cannot be read, or is invalid; the message names the line.
    """
    try:
        text = read_file(path, "a mapping", MAX_MAPPING_BYTES).decode()
    except UnicodeDecodeError as failure:
        raise InputError(f"{path}: expected TOML in UTF-8, got: {failure.reason}") from failure
    return parse_mapping(text, path.name)


def parse_mapping(text: str, name: str) -> RecordingMapping:
    """Returns the mapping in a text; see ``read_mapping``.

    Args:
        text: Text, as TOML.
        name: Name of the text in errors.
    """
    document, tables = parse_document(text, name)
    top = Table(document, (), tables)
    robot = top.text("robot")
    time = _time(top.table("time")) if top.has("time") else None
    table = time is not None
    mapping = RecordingMapping(
        document=document,
        robot=robot,
        control_timestep=_positive(top, "control_timestep"),
        controller=top.text("controller") if top.has("controller") else None,
        stage=top.choice("stage", STAGES, "single"),
        clock=COLUMN_CLOCK if table else top.choice("clock", CLOCKS, "header"),
        start=_start(top),
        duration=_positive(top, "duration"),
        joints=_angles(top.table("joints"), "joints", table=table),
        commands=_angles(top.table("commands"), "commands", table=table),
        base=_base(top.table("base"), table=table) if top.has("base") else None,
        imu=_imu(top.table("imu"), table=table) if top.has("imu") else None,
        touch=_touches(top.table("touch"), table=table) if top.has("touch") else {},
        time=time,
        sensors=_columns(top.table("sensors")) if table and top.has("sensors") else {},
    )
    top.done()
    return mapping


def _positive(top: Table, key: str) -> float | None:
    if not top.has(key):
        return None
    value = top.number(key)
    if value <= 0:
        raise top.document.error((key,), f"{key} must be above 0 s, got {value}: change it")
    return value


def _start(top: Table) -> float:
    value = top.number("start", 0.0)
    if value < 0:
        raise top.document.error(
            ("start",), f"start must be at least 0 s, got {value}: there is no data before"
        )
    return value


def _time(entries: Table) -> TimeColumn:
    found = TimeColumn(entries.text("column"), TIMES[entries.choice("unit", TIMES, "s")])
    entries.done()
    return found


def _topic(entries: Table, *, table: bool) -> str:
    return TABLE if table else entries.text("topic")


def _columns(entries: Table) -> dict[str, str]:
    """Names of columns by part of the robot."""
    return {part: entries.text(part) for part in entries.keys}


def _vectors(entries: Table, quantities: Iterable[str]) -> dict[str, tuple[str, ...]]:
    """Names of the columns of some ``VECTORS``."""
    found = {}
    for key in quantities:
        if entries.has(key):
            found[key] = entries.texts(key)
            if len(found[key]) != VECTORS[key]:
                raise entries.document.error(
                    (*entries.path, key),
                    f"{key} must list {VECTORS[key]} columns, got {len(found[key])}: change it",
                )
    return found


def _angles(entries: Table, role: Literal["joints", "commands"], *, table: bool) -> Angles:
    topic = _topic(entries, table=table)
    units = ANGLES if role == "joints" else COMMAND_UNITS
    scale = units[entries.choice("unit", units)]
    order: tuple[str, ...] = ()
    if role == "commands" and not table and entries.has("order"):
        order = entries.texts("order")
    names = entries.table("names")
    named = {name: _link(names, name, scale) for name in names.keys}
    links, absent = _measured(names, named, role)
    others = {
        key: _measured_columns(entries.table(key), named)
        if table and role == "joints" and entries.has(key)
        else {}
        for key in ("velocities", "efforts")
    }
    parts: dict[str, str] = {}
    ordered = frozenset(order)
    for name, link in links.items():
        if link.name == UNKNOWN:
            raise entries.document.error(
                (*names.path, name), f"{name} is still {UNKNOWN!r}: fill in its name in the bag"
            )
        if link.name in parts:
            raise entries.document.error(
                (*names.path, name),
                f"{link.name} is listed twice, for {parts[link.name]} and for {name}: expected "
                f"each joint of the bag once",
            )
        parts[link.name] = name
        if order and link.name not in ordered:
            raise entries.document.unknown((*names.path, name), "name in order", link.name, order)
    entries.done()
    return Angles(role, topic, scale, links, order, **others, absent=absent)


def _measured(
    names: Table, named: Mapping[str, Link], role: str
) -> tuple[dict[str, Link], tuple[str, ...]]:
    """Returns the conversions of parts with a name, and the hinges without an encoder."""
    links = {name: link for name, link in named.items() if link.name != NONE}
    absent = tuple(name for name in named if name not in links)
    if absent and role == "commands":
        raise names.document.error(
            (*names.path, absent[0]),
            f"{absent[0]} must have a command, got {NONE!r}, which is for hinges without an "
            f"encoder: fill in its name",
        )
    if absent and not links:
        raise names.document.error(
            names.path, f"expected the name of one joint or more, got {NONE!r} for all: fill it in"
        )
    return links, absent


def _measured_columns(entries: Table, named: Mapping[str, Link]) -> dict[str, str]:
    """Returns names of columns by hinge, without the hinges that have none."""
    columns = _columns(entries)
    for hinge, name in columns.items():
        if name == NONE and hinge not in named:
            raise entries.document.unknown((*entries.path, hinge), "hinge", hinge, named)
    return {hinge: name for hinge, name in columns.items() if name != NONE}


def _link(names: Table, name: str, scale: float) -> Link:
    value = names.value(name)
    path = (*names.path, name)
    if isinstance(value, str):
        return Link(value)
    if not isinstance(value, dict):
        raise names.document.error(
            path, f'{name} must be "a name in the bag" or {{ name = ... }}, got {shortened(value)}'
        )
    table = Table(names.document, path, value)
    recorded, sign = table.text("name"), table.number("sign", 1.0)
    offset = table.number("offset", 0.0) * scale
    table.done()
    if sign not in (1, -1):
        raise names.document.error((*path, "sign"), f"sign must be 1 or -1, got {sign:g}")
    return Link(recorded, sign, offset)


def _base(entries: Table, *, table: bool) -> Base:
    base = Base(
        topic=_topic(entries, table=table),
        frame=entries.choice("frame", FRAMES, "start"),
        scale=LENGTHS[entries.choice("unit", LENGTHS, "m")],
        velocity_frame=(
            entries.choice("velocity_frame", VELOCITY_FRAMES, "base") if table else "base"
        ),
        columns=_vectors(entries, VECTORS) if table else {},
    )
    if table and "position" not in base.columns and "orientation" not in base.columns:
        raise entries.document.error(
            entries.path, "[base] needs position or orientation, and has neither: add one"
        )
    entries.done()
    return base


def _imu(entries: Table, *, table: bool) -> Inertial:
    quantities = ("orientation", "angular_velocity") if table else ()
    found = Inertial(_topic(entries, table=table), _vectors(entries, quantities))
    if table and not found.columns:
        raise entries.document.error(
            entries.path, "[imu] needs orientation or angular_velocity, and has neither: add one"
        )
    entries.done()
    return found


def _touches(tables: Table, *, table: bool) -> dict[str, Touch]:
    return {name: _touch(tables.table(name), table=table) for name in tables.keys}


def _touch(entries: Table, *, table: bool) -> Touch:
    topic = _topic(entries, table=table)
    column = entries.text("column") if table else _index(entries)
    entries.choice("unit", FORCES, "N")
    touch = Touch(topic, column, entries.number("threshold", 0.0))
    entries.done()
    return touch


def _index(entries: Table) -> str:
    """Name of the column of a Float64MultiArray; "" if not given."""
    if not entries.has("index"):
        return ""
    index = entries.number("index")
    if index < 0 or index != int(index):
        raise entries.document.error(
            (*entries.path, "index"), f"index counts from 0, got {index:g}: change it"
        )
    return str(int(index))
