"""Mapping from the topics of a bag, or the columns of a table, to roles and parts of a robot."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

from selfmodel.logs.recordings.mapping.strict_toml import Document
from selfmodel.trials.trial import Stage

ANGLES: Mapping[str, float] = MappingProxyType({"rad": 1.0, "deg": math.pi / 180})
LENGTHS: Mapping[str, float] = MappingProxyType({"m": 1.0, "cm": 0.01, "mm": 0.001, "km": 1000.0})
FORCES = ("N", "kN", "raw")
"""Units of touch sensors; the threshold has the unit of the topic, so none is converted."""

UNKNOWN = "?"
"""Placeholder of a suggested mapping for a name that the user must fill in."""

NONE = "none"
"""Name of a hinge that has no encoder in the recording."""

COMMAND_UNITS: Mapping[str, float] = MappingProxyType({**ANGLES, "raw": 1.0})
"""Units of commands; ``raw`` is the unit of the motor, such as N m."""

TIMES: Mapping[str, int] = MappingProxyType({"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1})
"""Units of a time column, ns."""

RoleKind = Literal["joints", "commands", "base", "imu", "touch"]

CLOCKS = ("header", "log")
FRAMES = ("start", "recorded")
VELOCITY_FRAMES = ("base", "world")

TABLE = "table"
"""Topic of all roles in a table, whose columns have their times in common."""

COLUMN_CLOCK = "column"
"""Clock of a table: its time column."""

VECTORS: Mapping[str, int] = MappingProxyType(
    {"position": 3, "orientation": 4, "linear_velocity": 3, "angular_velocity": 3}
)
"""Number of columns of each quantity of a base or an IMU."""


@dataclass(frozen=True)
class Link:
    """Conversion of a recorded angle: angle = sign x recorded + offset.

    Attributes:
        name: Name in the bag.
        sign: Sign, 1 or -1.
        offset: Offset, rad.
    """

    name: str
    sign: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class Angles:
    """Topic of joint angles or of commanded angles.

    Attributes:
        role: ``joints`` or ``commands``.
        topic: Name of the topic.
        scale: Recorded unit, rad.
        links: Conversions by the model's hinge or motor; hinges without an encoder have none.
        order: Names of the columns of a Float64MultiArray; empty for other types.
        velocities: Columns of velocities in a table, by hinge.
        efforts: Columns of torques in a table, by hinge.
        absent: Hinges without an encoder in the recording, in the order of the mapping.
    """

    role: Literal["joints", "commands"]
    topic: str
    scale: float
    links: Mapping[str, Link]
    order: tuple[str, ...] = ()
    velocities: Mapping[str, str] = field(default_factory=dict)
    efforts: Mapping[str, str] = field(default_factory=dict)
    absent: tuple[str, ...] = ()


@dataclass(frozen=True)
class Base:
    """Topic of the pose of the root body.

    Attributes:
        topic: Name of the topic.
        frame: ``start``, in which the trial begins at x = y = 0 heading along +x; or ``recorded``.
        scale: Recorded unit, m.
        velocity_frame: Frame of the recorded linear velocity: ``base`` or ``world``.
        columns: Columns of a table by quantity, see ``VECTORS``; empty for a topic.
    """

    topic: str
    frame: str
    scale: float
    velocity_frame: str = "base"
    columns: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


@dataclass(frozen=True)
class Inertial:
    """Topic of an IMU.

    Attributes:
        topic: Name of the topic.
        columns: Columns of a table by quantity, see ``VECTORS``; empty for a topic.
    """

    topic: str
    columns: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


@dataclass(frozen=True)
class Touch:
    """Topic of one touch sensor.

    Attributes:
        topic: Name of the topic.
        column: Column of a Float64MultiArray or of a table; "" for other types.
        threshold: Value above which the sensor reads 1, in the unit of the topic.
    """

    topic: str
    column: str
    threshold: float


@dataclass(frozen=True)
class TimeColumn:
    """Time column of a table.

    Attributes:
        column: Name of the column.
        unit: Unit of its values, ns.
    """

    column: str
    unit: int


@dataclass(frozen=True)
class Role:
    """Role of a topic.

    Attributes:
        kind: Kind of the role.
        path: Table of the role in the mapping.
        topic: Name of the topic.
    """

    kind: RoleKind
    path: tuple[str, ...]
    topic: str

    @property
    def name(self) -> str:
        """Name for reports, such as ``touch.front_left_touch``."""
        return ".".join(self.path)


@dataclass(frozen=True)
class RecordingMapping:
    """Mapping of a file, checked for internal consistency.

    Attributes:
        document: Text of the mapping; errors name its lines.
        robot: Name of a robot, or an MJCF or URDF file.
        control_timestep: Control time step, s; with an MJCF or URDF file only.
        controller: File of the controller.
        stage: Stage of the trial: ``before`` for a healthy robot.
        clock: Clock of the times: ``header`` or ``log``; ``column`` for a table.
        start: Start of the trial after the first time at which every role has data, s.
        duration: Duration, s; None for as long as every role has data.
        joints: Topic of the hinges.
        commands: Topic of the motors.
        base: Topic of the root body.
        imu: Topic of an IMU.
        touch: Topics by touch sensor.
        time: Time column of a table; None for a bag.
        sensors: Columns of a table with the readings of sensors, by sensor.
    """

    document: Document
    robot: str
    control_timestep: float | None
    controller: str | None
    stage: Stage
    clock: str
    start: float
    duration: float | None
    joints: Angles
    commands: Angles
    base: Base | None
    imu: Inertial | None
    touch: Mapping[str, Touch]
    time: TimeColumn | None = None
    sensors: Mapping[str, str] = field(default_factory=dict)

    @property
    def roles(self) -> tuple[Role, ...]:
        """Roles of all mapped topics."""
        found = [
            Role("joints", ("joints",), self.joints.topic),
            Role("commands", ("commands",), self.commands.topic),
        ]
        if self.base is not None:
            found.append(Role("base", ("base",), self.base.topic))
        if self.imu is not None:
            found.append(Role("imu", ("imu",), self.imu.topic))
        found += [Role("touch", ("touch", name), touch.topic) for name, touch in self.touch.items()]
        return tuple(found)

    @property
    def columns(self) -> list[tuple[tuple[str, ...], str]]:
        """Columns of a table, each with the path of its entry in the mapping."""
        if self.time is None:
            return []
        found: list[tuple[tuple[str, ...], str]] = [(("time", "column"), self.time.column)]
        for angles in (self.joints, self.commands):
            path = angles.role
            found += [((path, "names", part), link.name) for part, link in angles.links.items()]
            found += [((path, "velocities", k), name) for k, name in angles.velocities.items()]
            found += [((path, "efforts", k), name) for k, name in angles.efforts.items()]
        for role, body in (("base", self.base), ("imu", self.imu)):
            vectors = {} if body is None else body.columns
            found += [((role, k), name) for k, names in vectors.items() for name in names]
        found += [(("touch", k, "column"), touch.column) for k, touch in self.touch.items()]
        found += [(("sensors", k), name) for k, name in self.sensors.items()]
        return found
