"""The mapping: which topic of a bag plays which role for which part of a robot."""

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
"""A touch sensor's threshold has the unit of its topic, so none of these needs converting."""

UNKNOWN = "?"
"""What a suggested mapping has in the place of a name that is still to be filled in."""

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
        stage: Where in a story the trial stands: ``before`` where nothing was wrong.
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
