"""Mapping from the topics of a bag, or the columns of a table, to the parts of a robot, as TOML.

A topic of a type without a role is a table, whose columns are the numbers in its messages, such as
``motor_state[3].q``. The classes are the tables of the file, and their fields its keys: any other
key is an error.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Literal

from msgspec import Meta, Struct

from selfmodel.logs.recordings.recording import TABLE
from selfmodel.trials.trial import Stage

UNKNOWN = "?"
"""Placeholder of a suggested mapping for a name that the user must fill in."""

NONE = "none"
"""Name of a hinge that has no encoder in the recording."""

UNITS: Mapping[str, float] = {
    "rad": 1.0,
    "deg": math.pi / 180,
    "raw": 1.0,
    "m": 1.0,
    "cm": 0.01,
    "mm": 0.001,
    "km": 1e3,
}
"""Units of angles, rad, and of lengths, m; ``raw`` is that of a motor, such as N m."""

TIMES: Mapping[str, int] = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}
"""Units of a time column, ns."""

Keys = tuple[str, ...]
"""Path of an entry: names of its tables, then its key."""

VECTORS: Mapping[str, Mapping[str, tuple[int, int]]] = {
    "base": {
        "position": (0, 3),
        "orientation": (3, 7),
        "linear_velocity": (7, 10),
        "angular_velocity": (10, 13),
    },
    "imu": {"orientation": (0, 4), "angular_velocity": (4, 7), "linear_acceleration": (7, 10)},
}
"""Numbers of each quantity of a body in the rows of ``messages.DECODERS``."""


@dataclass(frozen=True)
class Place:
    """Place of one quantity of a part of the robot in a recording.

    Attributes:
        path: Entry of the mapping; errors name its line.
        topic: Topic, with the columns side by side.
        numbers: Half-open range of the numbers of these columns.
        scale: Factor to the unit and the sign of the model; then ``offset`` is added.
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
"""Quantities and parts with their places."""

# ---------------------------------------------------------------- tables of the file

Number = Annotated[float, Meta(gt=-1e15, lt=1e15)]  # neither infinite nor nan
Positive = Annotated[float, Meta(gt=0, lt=1e15)]
Vector = tuple[str, str, str] | None
Quaternion = tuple[str, str, str, str] | None


class Section(Struct, forbid_unknown_fields=True):
    """Table of the file."""


class Link(Section):
    """Conversion of a recorded angle, in its unit: angle = sign * recorded + offset."""

    name: str
    sign: Number = 1.0
    offset: Number = 0.0

    def __post_init__(self) -> None:
        if self.sign not in (1, -1):
            raise ValueError(f"sign must be 1 or -1, got {self.sign:g}")


class Angles(Section):
    """Names in the recording by hinge or motor, and their unit; of a bag, their topic."""

    unit: Literal["rad", "deg", "raw"]
    names: dict[str, str | Link]
    topic: str = ""

    @property
    def links(self) -> dict[str, Link]:
        """Conversions by hinge or motor; a hinge without an encoder has none."""
        links = {k: Link(v) if isinstance(v, str) else v for k, v in self.names.items()}
        return {part: link for part, link in links.items() if link.name != NONE}

    def conversion(self, link: Link) -> tuple[float, float]:
        """Factor and offset of an angle, rad."""
        return link.sign * UNITS[self.unit], link.offset * UNITS[self.unit]


class Joints(Angles):
    """Joint angles; of a table, also the columns of other quantities by hinge."""

    unit: Literal["rad", "deg"]
    velocities: dict[str, str] = {}
    efforts: dict[str, str] = {}


class Commands(Angles):
    """Commands; a Float64MultiArray has the names of its numbers in ``order``."""

    order: tuple[str, ...] = ()


class Body(Section):
    """Topic or columns of the motion of a body."""

    topic: str = ""
    orientation: Quaternion = None
    angular_velocity: Vector = None

    @property
    def has_columns(self) -> bool:
        """Whether a vector has columns of its own."""
        return any(isinstance(getattr(self, key), tuple) for key in self.__struct_fields__)

    def __post_init__(self) -> None:
        if not self.topic and not self.has_columns:
            raise ValueError("this table needs topic, or the columns of a vector: add one")


class Imu(Body):
    """Topic or columns of an IMU, whose acceleration includes gravity, m/s^2."""

    linear_acceleration: Vector = None


class Base(Body):
    """Root body: its topic, whose velocities are in the frame of the base, or its columns.

    In the frame ``start``, the trial begins at x = y = 0 heading along +x. ``velocity_frame`` is
    that of the linear velocity of a table.
    """

    frame: Literal["start", "recorded"] = "start"
    unit: Literal["m", "cm", "mm", "km"] = "m"
    position: Vector = None
    linear_velocity: Vector = None
    velocity_frame: Literal["base", "world"] = "base"


class Touch(Section):
    """Touch sensor, which reads 1 above the threshold; no unit is converted.

    Its topic, with the index of its number in a Float64MultiArray, or its column.
    """

    threshold: Number = 0.0
    unit: Literal["N", "kN", "raw"] = "N"
    topic: str = ""
    index: Annotated[int, Meta(ge=0)] | None = None
    column: str = ""


class TimeColumn(Section):
    """Time column of a table."""

    column: str
    unit: Literal["s", "ms", "us", "ns"] = "s"


class Trial(Section, kw_only=True):
    """Trial in a recording.

    Attributes:
        robot: Name of a robot, or an MJCF or URDF file.
        control_timestep: Control time step, s; with an MJCF or URDF file only.
        controller: File of the controller.
        stage: Stage of the trial: ``before`` for a healthy robot.
        start: Start of the trial after the first time at which every role has data, s.
        duration: Duration, s; None for as long as every role has data.
        leave_out: First and last time of parts that are as if nothing but the commands had been
            recorded, s since the start of the trial.
        clock: Whether the times of a bag are time stamps or log times.
        time: Time column of a table; None for a bag.
        joints: Joint angles.
        commands: Commands of the motors.
        base: Root body.
        imu: IMU.
        touch: Touch sensors by name.
        sensors: Columns of the controller's readings by sensor, of a table.
    """

    robot: str
    control_timestep: Positive | None = None
    controller: str | None = None
    stage: Stage = "single"
    start: Annotated[float, Meta(ge=0, lt=1e15)] = 0.0
    duration: Positive | None = None
    leave_out: tuple[tuple[Number, Number], ...] = ()
    clock: Literal["header", "log"] = "header"
    time: TimeColumn | None = None
    joints: Joints
    commands: Commands
    base: Base | None = None
    imu: Imu | None = None
    touch: dict[str, Touch] = {}
    sensors: dict[str, str] = {}

    def places(self) -> Places:
        """Yields quantities and parts with their places.

        The quantities are signals, ``touch``, and those of ``VECTORS`` of the IMU, such as
        ``imu_orientation``; the part is "" for the base and the IMU.
        """
        joints, commands = self.joints, self.commands
        for hinge, link in joints.links.items():
            scale, offset = joints.conversion(link)
            path = ("joints", "names", hinge)
            place = partial(Place, path, joints.topic or TABLE, (link.name,))
            yield ("joint_positions", hinge), place((0, 1), scale, offset)
            if joints.topic:
                yield ("joint_velocities", hinge), place((1, 2), scale)
                yield ("joint_efforts", hinge), place((2, 3), link.sign)
        for key, columns in (("velocities", joints.velocities), ("efforts", joints.efforts)):
            for hinge, name in columns.items():
                link = joints.links.get(hinge, Link(NONE))
                scale = joints.conversion(link)[0] if key == "velocities" else link.sign
                if name != NONE:
                    path, topic = ("joints", key, hinge), joints.topic or TABLE
                    yield (f"joint_{key}", hinge), Place(path, topic, (name,), scale=scale)
        for motor, link in commands.links.items():
            column = str(commands.order.index(link.name)) if commands.order else link.name
            place = partial(Place, ("commands", "names", motor), commands.topic or TABLE, (column,))
            yield ("commands", motor), place((0, 1), *commands.conversion(link))
        yield from _vectors("base", self.base)
        yield from _vectors("imu", self.imu)
        for name, touch in self.touch.items():
            column = touch.column or ("" if touch.index is None else str(touch.index))
            path = ("touch", name, "column" if touch.column or not touch.topic else "index")
            yield ("touch", name), Place(path, touch.topic or TABLE, (column,))
        for sensor, name in self.sensors.items():
            yield ("sensors", sensor), Place(("sensors", sensor), TABLE, (name,))


def _vectors(body: str, section: Body | None) -> Places:
    if section is None:
        return
    for key, numbers in VECTORS[body].items():
        scale = 1.0
        if isinstance(section, Base) and key in ("position", "linear_velocity"):
            scale = UNITS[section.unit]
        quantity = (f"{body}_{key}", "")
        if columns := getattr(section, key):
            yield quantity, Place((body, key), section.topic or TABLE, columns, scale=scale)
        elif section.topic and not section.has_columns:
            yield quantity, Place((body, "topic"), section.topic, ("",), numbers, scale)
