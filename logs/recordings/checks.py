"""Checks of a mapping against robot and recording; an error names the line and the alternatives."""

from collections.abc import Iterable, Mapping
from types import MappingProxyType

from selfmodel.errors import unknown_name
from selfmodel.logs.recordings.mapping import NONE, Keys, Place, TableMapping
from selfmodel.logs.recordings.mapping_file import RecordingMapping
from selfmodel.logs.recordings.messages import (
    ARRAY,
    IMU,
    JOINT_STATE,
    NUMBERS,
    ODOMETRY,
    POSE,
    TRAJECTORY,
    WRENCH,
)
from selfmodel.logs.recordings.recording import TABLE, Recording
from selfmodel.robot.anatomy import Anatomy

TYPES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "joints": (JOINT_STATE,),
        "commands": (JOINT_STATE, ARRAY, TRAJECTORY),
        "base": (ODOMETRY, POSE),
        "imu": (IMU,),
        "touch": (WRENCH, *NUMBERS, ARRAY),
    }
)
"""Message types that can play each role."""


def check_robot(mapping: RecordingMapping, anatomy: Anatomy) -> None:
    """Checks that a mapping names the parts of the robot and no others.

    All hinges must be mapped, some to ``NONE``, and all motors.

    Raises:
        InputError: The mapping names an unknown part, or omits a required part.
    """
    trial = mapping.trial
    touches = [sensor.name for sensor in anatomy.sensors if sensor.kind == "touch"]
    parts: list[tuple[Keys, Iterable[str], str, Iterable[str]]] = [
        (("joints", "names"), trial.joints.names, "hinge", anatomy.hinges),
        (("commands", "names"), trial.commands.names, "motor", anatomy.motors),
        (("touch",), trial.touch, "touch sensor", touches),
    ]
    if isinstance(trial, TableMapping):
        velocities, efforts = trial.joints.velocities, trial.joints.efforts
        parts.append((("joints", "velocities"), velocities, "hinge", anatomy.hinges))
        parts.append((("joints", "efforts"), efforts, "hinge", anatomy.hinges))
        parts.append((("sensors",), trial.sensors, "sensor", anatomy.names.sensors))
    for path, listed, what, known in parts:
        for name in listed:
            if name not in known:
                raise mapping.unknown((*path, name), f"{what} of the robot", name, known)
        if path[-1] == "names" and (missing := [name for name in known if name not in listed]):
            advice = f", with {NONE!r} for a hinge without an encoder" if what == "hinge" else ""
            raise mapping.error(
                path,
                f"[{'.'.join(path)}] must list every {what} of the robot, and lacks "
                f"{', '.join(missing)}: add a line for each{advice}",
            )


def check_recording(mapping: RecordingMapping, recording: Recording) -> None:
    """Checks that a recording has what a mapping names, of a type that can play its role.

    Raises:
        InputError: A topic or a column is missing, or unsuitable.
    """
    for place in mapping.places.values():
        if place.topic != TABLE:
            _check_topic(mapping, recording, place)
    orders = getattr(mapping.trial.commands, "order", ())
    for place in mapping.places.values():
        columns = recording.series[place.topic].names
        if place.role == ("commands",) and orders:
            if len(orders) != len(columns):
                raise mapping.error(
                    ("commands", "order"),
                    f"order must name the {len(columns)} numbers of a message on {place.topic}, "
                    f"got {len(orders)} names",
                )
            continue
        for name in place.columns:
            if name and name not in columns:
                kind = "number" if place.role[0] == "touch" else "joint"
                what = "column of the table" if place.topic == TABLE else f"{kind} on {place.topic}"
                error = str(unknown_name(what, name, columns))
                lost = f"; {NONE!r} is for a hinge without an encoder"
                raise mapping.error(place.path, error + (lost if place.role == ("joints",) else ""))


def _check_topic(mapping: RecordingMapping, recording: Recording, place: Place) -> None:
    """Checks that a topic exists, has a suitable type, and has messages."""
    path, kinds = (*place.role, "topic"), TYPES[place.role[0]]
    fitting = [topic for topic, series in recording.series.items() if series.type in kinds]
    series = recording.series.get(place.topic)
    if series is None:
        known = fitting or sorted(recording.series)
        raise mapping.unknown(path, "topic of the bag", place.topic, known)
    if series.type not in kinds:
        raise mapping.error(
            path,
            f"expected a topic of {' or '.join(kinds)} for {'.'.join(place.role)}, got "
            f"{place.topic} of {series.type or 'no type'}: name one that fits, of "
            f"{', '.join(fitting) or 'which the bag has none'}",
        )
    if not series.count:
        raise mapping.error(path, f"expected messages on {place.topic}, got none: name another one")
    key = {"commands": "order", "touch": "index"}.get(place.role[0])
    if key is not None:
        table = mapping.trial.commands if key == "order" else mapping.trial.touch[place.role[1]]
        named = getattr(table, key) not in (None, ())
        if series.type == ARRAY and not named:
            raise mapping.error(
                place.role,
                f"{place.topic} has numbers without names ({ARRAY}): add {key} to "
                f"[{'.'.join(place.role)}], which names them",
            )
        if named and series.type != ARRAY:
            raise mapping.error(
                (*place.role, key),
                f"{key} is for topics of {ARRAY}, got one of {series.type} on {place.topic}: "
                f"remove it",
            )
