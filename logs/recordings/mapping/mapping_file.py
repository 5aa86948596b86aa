"""Strict reader of mapping files: an entry without effect is an error."""

from pathlib import Path
from typing import Literal

from selfmodel.errors import InputError
from selfmodel.files import read_file
from selfmodel.logs.recordings.mapping.mapping import (
    ANGLES,
    CLOCKS,
    FORCES,
    FRAMES,
    LENGTHS,
    UNKNOWN,
    Angles,
    BagMapping,
    Base,
    Link,
    Touch,
)
from selfmodel.logs.recordings.mapping.strict_toml import Table, parse_document, shortened
from selfmodel.trials.trial import STAGES

MAX_MAPPING_BYTES = 2**20
"""Maximum size of a mapping, bytes."""


def read_mapping(path: Path) -> BagMapping:
    """Returns the mapping in a file.

    Raises:
        InputError: The file cannot be read, or is invalid; the message names the line.
    """
    try:
        text = read_file(path, "a mapping", MAX_MAPPING_BYTES).decode()
    except UnicodeDecodeError as failure:
        raise InputError(f"{path}: expected TOML in UTF-8, got: {failure.reason}") from failure
    return parse_mapping(text, path.name)


def parse_mapping(text: str, name: str) -> BagMapping:
    """Returns the mapping in a text; see ``read_mapping``.

    Args:
        text: Text, as TOML.
        name: Name of the text in errors.
    """
    document, tables = parse_document(text, name)
    top = Table(document, (), tables)
    robot = top.text("robot")
    mapping = BagMapping(
        document=document,
        robot=robot,
        control_timestep=_positive(top, "control_timestep"),
        controller=top.text("controller") if top.has("controller") else None,
        stage=top.choice("stage", STAGES, "single"),
        clock=top.choice("clock", CLOCKS, "header"),
        start=_start(top),
        duration=_positive(top, "duration"),
        joints=_angles(top.table("joints"), "joints"),
        commands=_angles(top.table("commands"), "commands"),
        base=_base(top.table("base")) if top.has("base") else None,
        imu=_imu(top.table("imu")) if top.has("imu") else None,
        touch=_touches(top.table("touch")) if top.has("touch") else {},
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


def _angles(table: Table, role: Literal["joints", "commands"]) -> Angles:
    topic = table.text("topic")
    scale = ANGLES[table.choice("unit", ANGLES)]
    order: tuple[str, ...] = ()
    if role == "commands" and table.has("order"):
        order = table.texts("order")
    names = table.table("names")
    links = {name: _link(names, name, scale) for name in names.keys}
    parts: dict[str, str] = {}
    ordered = frozenset(order)
    for name, link in links.items():
        if link.name == UNKNOWN:
            raise table.document.error(
                (*names.path, name), f"{name} is still {UNKNOWN!r}: fill in its name in the bag"
            )
        if link.name in parts:
            raise table.document.error(
                (*names.path, name),
                f"{link.name} is listed twice, for {parts[link.name]} and for {name}: expected "
                f"each joint of the bag once",
            )
        parts[link.name] = name
        if order and link.name not in ordered:
            raise table.document.unknown((*names.path, name), "name in order", link.name, order)
    table.done()
    return Angles(role, topic, scale, links, order)


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


def _base(table: Table) -> Base:
    base = Base(
        topic=table.text("topic"),
        frame=table.choice("frame", FRAMES, "start"),
        scale=LENGTHS[table.choice("unit", LENGTHS, "m")],
    )
    table.done()
    return base


def _imu(table: Table) -> str:
    topic = table.text("topic")
    table.done()
    return topic


def _touches(tables: Table) -> dict[str, Touch]:
    return {name: _touch(tables.table(name)) for name in tables.keys}


def _touch(table: Table) -> Touch:
    column = ""
    topic = table.text("topic")
    if table.has("index"):
        index = table.number("index")
        if index < 0 or index != int(index):
            raise table.document.error(
                (*table.path, "index"), f"index counts from 0, got {index:g}: change it"
            )
        column = str(int(index))
    table.choice("unit", FORCES, "N")
    touch = Touch(topic, column, table.number("threshold", 0.0))
    table.done()
    return touch
