"""Mapping from the parts of a robot to the topics of a bag."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

from selfmodel.logs.rosbag.tables import Document
from selfmodel.trials.trial import Stage

ANGLES: Mapping[str, float] = MappingProxyType({"rad": 1.0, "deg": math.pi / 180})
LENGTHS: Mapping[str, float] = MappingProxyType({"m": 1.0, "cm": 0.01, "mm": 0.001, "km": 1000.0})
FORCES = ("N", "kN", "raw")
"""Units of a touch threshold; it has the unit of its topic, so no unit is converted."""

UNKNOWN = "?"
"""Placeholder in a suggested mapping for a name that the user must fill in."""

RoleKind = Literal["joints", "commands", "base", "imu", "touch"]

CLOCKS = ("header", "log")
FRAMES = ("start", "recorded")


@dataclass(frozen=True)
class Link:
    """Conversion of a recorded angle: angle = sign x recorded + offset.

    Attributes:
        name: Name of the part in the bag.
        sign: 1 or -1.
        offset: Offset, rad.
    """

    name: str
    sign: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class Angles:
    """A topic of measured joint angles, or of commanded angles.

    Attributes:
        role: ``joints`` or ``commands``.
        topic: Name of the topic.
        scale: Unit of the topic, rad.
        links: Conversions by the model's hinge or motor.
        order: Names of the numbers of a Float64MultiArray; empty for other types.
    """

    role: Literal["joints", "commands"]
    topic: str
    scale: float
    links: Mapping[str, Link]
    order: tuple[str, ...] = ()


@dataclass(frozen=True)
class Base:
    """A topic of the pose of the base.

    Attributes:
        topic: Name of the topic.
        frame: Frame of the imported pose: ``start``, in which the trial starts at x = y = 0 and
            heads along +x, or ``recorded``.
        scale: Unit of the topic, m.
    """

    topic: str
    frame: str
    scale: float


@dataclass(frozen=True)
class Touch:
    """A topic of one touch sensor.

    Attributes:
        topic: Name of the topic.
        column: Index of the number in a Float64MultiArray, as text; "" for other types.
        threshold: Upper bound of the values with the reading 0, in the unit of the topic.
    """

    topic: str
    column: str
    threshold: float


@dataclass(frozen=True)
class Role:
    """A role of a topic.

    Attributes:
        kind: Kind of the role.
        path: Keys of its table in the mapping.
        topic: Name of the topic.
    """

    kind: RoleKind
    path: tuple[str, ...]
    topic: str

    @property
    def name(self) -> str:
        """Name of the role in reports, such as ``touch.front_left_touch``."""
        return ".".join(self.path)


@dataclass(frozen=True)
class BagMapping:
    """A mapping of a bag, consistent in itself.

    Attributes:
        document: Text of the mapping, with the lines of its keys for error messages.
        robot: Name of a robot, or path of an MJCF file.
        control_timestep: Control time step, s; given with an MJCF file only.
        controller: Path of the controller's file; None if the controller is unknown.
        stage: Stage of the trial, such as ``before`` for a healthy robot.
        clock: Clock of the times, ``header`` or ``log``.
        start: Start of the trial after the first time at which every role has data, s.
        duration: Duration, s; None for as long as every role has data.
        joints: Topic of the joint angles.
        commands: Topic of the commands.
        base: Topic of the base's pose, or None.
        imu: Name of the Imu topic, or None.
        touch: Topics by the robot's touch sensor.
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
    imu: str | None
    touch: Mapping[str, Touch]

    @property
    def roles(self) -> tuple[Role, ...]:
        """All roles of the mapping."""
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
