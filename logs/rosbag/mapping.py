"""The mapping: which topic of a bag plays which role for which part of a robot."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Literal

from selfmodel.errors import InputError
from selfmodel.logs.rosbag.tables import Document, Table, parse_document

ANGLES: Mapping[str, float] = MappingProxyType({"rad": 1.0, "deg": math.pi / 180})
LENGTHS: Mapping[str, float] = MappingProxyType({"m": 1.0, "cm": 0.01, "mm": 0.001, "km": 1000.0})
FORCES = ("N", "kN", "raw")
"""A touch sensor's threshold has the unit of its topic, so none of these needs converting."""

RoleKind = Literal["joints", "commands", "base", "imu", "touch"]

CLOCKS = ("header", "log")
FRAMES = ("start", "recorded")


@dataclass(frozen=True)
class Link:
    """How a part of the model is told of in the bag: its angle = sign x recorded + offset.

    Attributes:
        name: What the bag calls it.
        sign: 1 or -1.
        offset: Radians.
    """

    name: str
    sign: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class Angles:
    """A topic that tells angles: of the joints, or those that are commanded.

    Attributes:
        role: ``joints`` or ``commands``.
        topic: Which.
        scale: Radians in its unit.
        links: By the model's hinge or motor.
        order: Names of the columns of a Float64MultiArray; empty for other types.
    """

    role: Literal["joints", "commands"]
    topic: str
    scale: float
    links: Mapping[str, Link]
    order: tuple[str, ...] = ()


@dataclass(frozen=True)
class Base:
    """The topic that tells where the root body is.

    Attributes:
        topic: Which.
        frame: ``start``: the trial begins at x = y = 0 heading along +x; or ``recorded``.
        scale: Metres in its unit.
    """

    topic: str
    frame: str
    scale: float


@dataclass(frozen=True)
class Touch:
    """A topic that tells of one touch sensor.

    Attributes:
        topic: Which.
        column: Which number of a Float64MultiArray; "" for other types.
        threshold: The sensor reads 1 above this.
    """

    topic: str
    column: str
    threshold: float


@dataclass(frozen=True)
class Role:
    """A role that a topic plays.

    Attributes:
        kind: Which.
        path: Its table in the mapping.
        topic: Who plays it.
    """

    kind: RoleKind
    path: tuple[str, ...]
    topic: str

    @property
    def name(self) -> str:
        """What reports call it, such as ``touch.front_left_touch``."""
        return ".".join(self.path)


@dataclass(frozen=True)
class BagMapping:
    """A mapping as it was written, checked against itself.

    Attributes:
        document: Its text; complaints name its lines.
        robot: A robot's name, or an MJCF file.
        control_timestep: Seconds; given with an MJCF file only.
        controller: What drove the robot: a file.
        clock: ``header`` or ``log``.
        start: Seconds after the first moment at which every role has data.
        duration: Seconds; None for as long as every role has data.
        joints: The hinges.
        commands: The motors.
        base: The root body's motion.
        imu: The topic of an Imu.
        touch: By the robot's touch sensor.
    """

    document: Document
    robot: str
    control_timestep: float | None
    controller: str | None
    clock: str
    start: float
    duration: float | None
    joints: Angles
    commands: Angles
    base: Base | None
    imu: str | None
    touch: Mapping[str, Touch]

    @property
    def roles(self) -> tuple[Role, ...]:
        """Every role that a topic plays."""
        found = [
            Role("joints", ("joints",), self.joints.topic),
            Role("commands", ("commands",), self.commands.topic),
        ]
        if self.base is not None:
            found.append(Role("base", ("base",), self.base.topic))
        if self.imu is not None:
            found.append(Role("imu", ("imu",), self.imu))
        found += [Role("touch", ("touch", name), touch.topic) for name, touch in self.touch.items()]
        return tuple(found)


def read_mapping(path: Path) -> BagMapping:
    """Returns the mapping in a file.

    Raises:
        InputError: It cannot be read, or is wrong; the sentence names the line.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as failure:
        raise InputError(
            f"{path}: expected a mapping that can be read, got: {failure.strerror}"
        ) from failure
    except UnicodeDecodeError as failure:
        raise InputError(f"{path}: expected TOML in UTF-8, got: {failure.reason}") from failure
    return parse_mapping(text, path.name)


def parse_mapping(text: str, name: str) -> BagMapping:
    """Returns the mapping that a text says; see ``read_mapping``.

    Args:
        text: TOML.
        name: What errors call it.
    """
    document, tables = parse_document(text, name)
    top = Table(document, (), tables)
    robot = top.text("robot")
    mapping = BagMapping(
        document=document,
        robot=robot,
        control_timestep=_positive(top, "control_timestep"),
        controller=top.text("controller") if top.has("controller") else None,
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


def check_names(
    mapping: BagMapping, hinges: Iterable[str], motors: Iterable[str], touches: Iterable[str]
) -> None:
    """Checks a mapping against the robot.

    Args:
        mapping: What to check.
        hinges: The robot's hinges: each must be mapped.
        motors: Its motors: each must be mapped.
        touches: Its touch sensors: each may be.

    Raises:
        InputError: It names a part that there is not, or leaves out one.
    """
    document = mapping.document
    for angles, what, known in (
        (mapping.joints, "hinge", list(hinges)),
        (mapping.commands, "motor", list(motors)),
    ):
        path = (angles.role, "names")
        for name in angles.links:
            if name not in known:
                raise document.unknown((*path, name), f"{what} of the robot", name, known)
        if missing := [name for name in known if name not in angles.links]:
            raise document.error(
                path,
                f"[{'.'.join(path)}] must list every {what} of the robot, and lacks "
                f"{', '.join(missing)}: add a line for each",
            )
    for name in mapping.touch:
        if name not in (known := list(touches)):
            raise document.unknown(("touch", name), "touch sensor of the robot", name, known)


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
    told: dict[str, str] = {}
    for name, link in links.items():
        if link.name in told:
            raise table.document.error(
                (*names.path, name),
                f"{link.name} is listed twice, for {told[link.name]} and for {name}: expected "
                f"each joint of the bag once",
            )
        told[link.name] = name
        if order and link.name not in order:
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
            path, f'{name} must be "a name in the bag" or {{ name = ... }}, got {value!r}'
        )
    table = Table(names.document, path, value)
    told, sign = table.text("name"), table.number("sign", 1.0)
    offset = table.number("offset", 0.0) * scale
    table.done()
    if sign not in (1, -1):
        raise names.document.error((*path, "sign"), f"sign must be 1 or -1, got {sign:g}")
    return Link(told, sign, offset)


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
