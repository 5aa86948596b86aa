"""Mapping from the topics of a bag to roles and parts of a robot."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
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

RoleKind = Literal["joints", "commands", "base", "imu", "touch"]

CLOCKS = ("header", "log")
FRAMES = ("start", "recorded")


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
        links: Conversions by the model's hinge or motor.
        order: Names of the columns of a Float64MultiArray; empty for other types.
    """

    role: Literal["joints", "commands"]
    topic: str
    scale: float
    links: Mapping[str, Link]
    order: tuple[str, ...] = ()


@dataclass(frozen=True)
class Base:
    """Topic of the pose of the root body.

    Attributes:
        topic: Name of the topic.
        frame: ``start``, in which the trial begins at x = y = 0 heading along +x; or ``recorded``.
        scale: Recorded unit, m.
    """

    topic: str
    frame: str
    scale: float


@dataclass(frozen=True)
class Touch:
    """Topic of one touch sensor.

    Attributes:
        topic: Name of the topic.
        column: Column of a Float64MultiArray; "" for other types.
        threshold: Value above which the sensor reads 1, in the unit of the topic.
    """

    topic: str
    column: str
    threshold: float


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
class BagMapping:
    """Mapping of a file, checked for internal consistency.

    Attributes:
        document: Text of the mapping; errors name its lines.
        robot: Name of a robot, or an MJCF file.
        control_timestep: Control time step, s; with an MJCF file only.
        controller: File of the controller.
        stage: Stage of the trial: ``before`` for a healthy robot.
        clock: Clock of the times: ``header`` or ``log``.
        start: Start of the trial after the first time at which every role has data, s.
        duration: Duration, s; None for as long as every role has data.
        joints: Topic of the hinges.
        commands: Topic of the motors.
        base: Topic of the root body.
        imu: Name of the topic of an Imu.
        touch: Topics by touch sensor.
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
        """Roles of all mapped topics."""
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
