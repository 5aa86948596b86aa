"""Mapping from the topics of a bag, or the columns of a table, to the parts of a robot, as TOML.

The classes are the tables of the file, and their fields its keys: any other key is an error. Each
error names its line.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Annotated, Literal

from msgspec import Meta, Struct

from selfmodel.logs.recordings.recording import TABLE
from selfmodel.trials.trial import Stage

UNKNOWN = "?"
"""Placeholder of a suggested mapping for a name that the user must fill in."""

NONE = "none"
"""Name of a hinge that has no encoder in the recording."""

UNITS: Mapping[str, float] = MappingProxyType(
    {"rad": 1.0, "deg": math.pi / 180, "raw": 1.0, "m": 1.0, "cm": 0.01, "mm": 0.001, "km": 1e3}
)
"""Units of angles, rad, and of lengths, m; ``raw`` is that of a motor, such as N m."""

TIMES: Mapping[str, int] = MappingProxyType({"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1})
"""Units of a time column, ns."""

Keys = tuple[str, ...]
"""Path of an entry: names of its tables, then its key."""


@dataclass(frozen=True)
class Place:
    """Place of one quantity of a part of the robot in a recording.

    Attributes:
        path: Entry of the mapping; errors name its line.
        topic: Topic.
        columns: Columns on that topic, side by side.
        numbers: Half-open range of the numbers of these columns.
        scale: Factor to the unit and the sign of the model.
        offset: Offset after the factor.
    """

    path: Keys
    topic: str
    columns: tuple[str, ...]
    numbers: tuple[int, int | None] = (0, None)
    scale: float = 1.0
    offset: float = 0.0

    @property
    def role(self) -> Keys:
        """Table of the topic in the mapping, such as ``("touch", "left_foot")``."""
        return self.path[:2] if self.path[0] == "touch" else self.path[:1]


Places = Iterator[tuple[tuple[str, str], Place]]
"""Quantities and parts with their places.

The quantities are signals, ``touch``, ``imu_orientation`` and ``imu_angular_velocity``; the part is
"" for the base and the IMU.
"""

# ---------------------------------------------------------------- tables of the file

Number = Annotated[float, Meta(gt=-1e15, lt=1e15)]  # neither infinite nor nan
Positive = Annotated[float, Meta(gt=0, lt=1e15)]
Vector = tuple[str, str, str]
Quaternion = tuple[str, str, str, str]


class Section(Struct, forbid_unknown_fields=True):
    """Table of the file."""


class Link(Section):
    """Conversion of a recorded angle: angle = sign * recorded + offset.

    Attributes:
        name: Name in the recording.
        sign: Sign, 1 or -1.
        offset: Offset in the unit of the recording.
    """

    name: str
    sign: Number = 1.0
    offset: Number = 0.0

    def __post_init__(self) -> None:
        """Checks the sign."""
        if self.sign not in (1, -1):
            raise ValueError(f"sign must be 1 or -1, got {self.sign:g}")


class Angles(Section):
    """Names in the recording by hinge or motor, and their unit."""

    unit: Literal["rad", "deg", "raw"]
    names: dict[str, str | Link]

    @property
    def links(self) -> dict[str, Link]:
        """Conversions by hinge or motor; a hinge without an encoder has none."""
        links = {k: Link(v) if isinstance(v, str) else v for k, v in self.names.items()}
        return {part: link for part, link in links.items() if link.name != NONE}

    def conversion(self, link: Link) -> tuple[float, float]:
        """Factor and offset of an angle, rad."""
        return link.sign * UNITS[self.unit], link.offset * UNITS[self.unit]


class BagJoints(Angles):
    """Topic of the joint angles."""

    unit: Literal["rad", "deg"]
    topic: str


class BagCommands(Angles):
    """Topic of the commands; a Float64MultiArray has the names of its numbers here."""

    topic: str
    order: tuple[str, ...] = ()


class TableJoints(Angles):
    """Columns of the joint angles, and of other quantities by hinge."""

    unit: Literal["rad", "deg"]
    velocities: dict[str, str] = {}
    efforts: dict[str, str] = {}


class Base(Section):
    """Root body; in the frame ``start``, the trial begins at x = y = 0 heading along +x."""

    frame: Literal["start", "recorded"] = "start"
    unit: Literal["m", "cm", "mm", "km"] = "m"


class BagBase(Base, kw_only=True):
    """Topic of the root body; its velocities are in the frame of the base."""

    topic: str


class TableBase(Base):
    """Columns of the root body; ``velocity_frame`` is that of the linear velocity."""

    position: Vector | None = None
    orientation: Quaternion | None = None
    linear_velocity: Vector | None = None
    angular_velocity: Vector | None = None
    velocity_frame: Literal["base", "world"] = "base"

    def __post_init__(self) -> None:
        """Checks that there is a pose."""
        if self.position is None and self.orientation is None:
            raise ValueError("[base] needs position or orientation, and has neither: add one")


class BagImu(Section):
    """Topic of an IMU."""

    topic: str


class TableImu(Section):
    """Columns of an IMU."""

    orientation: Quaternion | None = None
    angular_velocity: Vector | None = None

    def __post_init__(self) -> None:
        """Checks that there is a measurement."""
        if self.orientation is None and self.angular_velocity is None:
            raise ValueError("[imu] needs orientation or angular_velocity: add one")


class Touch(Section):
    """Touch sensor, which reads 1 above the threshold; no unit is converted."""

    threshold: Number = 0.0
    unit: Literal["N", "kN", "raw"] = "N"


class BagTouch(Touch, kw_only=True):
    """Topic of a touch sensor; of a Float64MultiArray, the index of its number."""

    topic: str
    index: Annotated[int, Meta(ge=0)] | None = None


class TableTouch(Touch, kw_only=True):
    """Column of a touch sensor."""

    column: str


class TimeColumn(Section):
    """Time column of a table."""

    column: str
    unit: Literal["s", "ms", "us", "ns"] = "s"


class Trial(Section):
    """Trial in a recording.

    Attributes:
        robot: Name of a robot, or an MJCF or URDF file.
        control_timestep: Control time step, s; with an MJCF or URDF file only.
        controller: File of the controller.
        stage: Stage of the trial: ``before`` for a healthy robot.
        start: Start of the trial after the first time at which every role has data, s.
        duration: Duration, s; None for as long as every role has data.
    """

    robot: str
    control_timestep: Positive | None = None
    controller: str | None = None
    stage: Stage = "single"
    start: Annotated[float, Meta(ge=0, lt=1e15)] = 0.0
    duration: Positive | None = None


class BagMapping(Trial, kw_only=True):
    """Mapping of the topics of a bag, whose times are time stamps or log times."""

    clock: Literal["header", "log"] = "header"
    joints: BagJoints
    commands: BagCommands
    base: BagBase | None = None
    imu: BagImu | None = None
    touch: dict[str, BagTouch] = {}

    def places(self) -> Places:
        """Yields the places of all quantities; for the numbers, see ``DECODERS`` in ``bags``."""
        joints, commands = self.joints, self.commands
        for hinge, link in joints.links.items():
            scale, offset = joints.conversion(link)
            place = partial(Place, ("joints", "names", hinge), joints.topic, (link.name,))
            yield ("joint_positions", hinge), place((0, 1), scale, offset)
            yield ("joint_velocities", hinge), place((1, 2), scale)
            yield ("joint_efforts", hinge), place((2, 3), link.sign)
        for motor, link in commands.links.items():
            column = str(commands.order.index(link.name)) if commands.order else link.name
            place = partial(Place, ("commands", "names", motor), commands.topic, (column,))
            yield ("commands", motor), place((0, 1), *commands.conversion(link))
        if self.base is not None:
            place = partial(Place, ("base", "topic"), self.base.topic, ("",))
            length = UNITS[self.base.unit]
            yield ("base_position", ""), place((0, 3), length)
            yield ("base_orientation", ""), place((3, 7))
            yield ("base_linear_velocity", ""), place((7, 10), length)
            yield ("base_angular_velocity", ""), place((10, 13))
        if self.imu is not None:
            place = partial(Place, ("imu", "topic"), self.imu.topic, ("",))
            yield ("imu_orientation", ""), place((0, 4))
            yield ("imu_angular_velocity", ""), place((4, 7))
        for name, touch in self.touch.items():
            column = "" if touch.index is None else str(touch.index)
            yield ("touch", name), Place(("touch", name, "index"), touch.topic, (column,))


class TableMapping(Trial, kw_only=True):
    """Mapping of the columns of a table; those of ``sensors`` are a controller's readings."""

    time: TimeColumn
    joints: TableJoints
    commands: Angles
    base: TableBase | None = None
    imu: TableImu | None = None
    touch: dict[str, TableTouch] = {}
    sensors: dict[str, str] = {}

    @property
    def clock(self) -> str:
        """Clock of the times: the time column."""
        return "column"

    def places(self) -> Places:
        """Yields the places of all quantities."""
        joints = self.joints
        for quantity, role, angles in (
            ("joint_positions", "joints", joints),
            ("commands", "commands", self.commands),
        ):
            for part, link in angles.links.items():
                scale, offset = angles.conversion(link)
                path = (role, "names", part)
                yield (quantity, part), Place(path, TABLE, (link.name,), scale=scale, offset=offset)
        for key, columns in (("velocities", joints.velocities), ("efforts", joints.efforts)):
            for hinge, name in columns.items():
                link = joints.links.get(hinge, Link(NONE))
                scale = joints.conversion(link)[0] if key == "velocities" else link.sign
                if name != NONE:
                    path = ("joints", key, hinge)
                    yield (f"joint_{key}", hinge), Place(path, TABLE, (name,), scale=scale)
        yield from self._vectors(
            "base", self.base, UNITS["m" if self.base is None else self.base.unit]
        )
        yield from self._vectors("imu", self.imu)
        for name, touch in self.touch.items():
            yield ("touch", name), Place(("touch", name, "column"), TABLE, (touch.column,))
        for sensor, name in self.sensors.items():
            yield ("sensors", sensor), Place(("sensors", sensor), TABLE, (name,))

    def _vectors(self, body: str, section: Section | None, length: float = 1.0) -> Places:
        for key in ("position", "orientation", "linear_velocity", "angular_velocity"):
            if names := getattr(section, key, None):
                scale = length if key in ("position", "linear_velocity") else 1.0
                yield (f"{body}_{key}", ""), Place((body, key), TABLE, names, scale=scale)
