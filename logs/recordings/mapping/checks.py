"""Checks of a mapping against robot and bag; an error names the line and the alternatives."""

from collections.abc import Collection, Mapping, Sequence
from types import MappingProxyType

from selfmodel.errors import unknown_name
from selfmodel.logs.recordings.mapping.mapping import NONE, RecordingMapping, Role, RoleKind
from selfmodel.logs.recordings.mapping.strict_toml import Document
from selfmodel.logs.recordings.rosbag.bag import Bag
from selfmodel.logs.recordings.rosbag.message_types import (
    ARRAY,
    IMU,
    JOINT_STATE,
    NUMBERS,
    ODOMETRY,
    POSE,
    TRAJECTORY,
    WRENCH,
)
from selfmodel.logs.recordings.series import Series

TYPES: Mapping[RoleKind, tuple[str, ...]] = MappingProxyType(
    {
        "joints": (JOINT_STATE,),
        "commands": (JOINT_STATE, ARRAY, TRAJECTORY),
        "base": (ODOMETRY, POSE),
        "imu": (IMU,),
        "touch": (WRENCH, *NUMBERS, ARRAY),
    }
)
"""Message types that can play each role."""


def check_names(
    mapping: RecordingMapping,
    hinges: Sequence[str],
    motors: Sequence[str],
    touches: Sequence[str],
    sensors: Sequence[str],
) -> None:
    """Checks that a mapping names the parts of the robot and no others.

    Args:
        mapping: The mapping.
        hinges: Hinges of the robot; all must be mapped, some to ``NONE``.
        motors: Motors of the robot; all must be mapped.
        touches: Touch sensors of the robot; some may be mapped.
        sensors: All sensors of the robot; some may be mapped.

    Raises:
        InputError: The mapping names an unknown part, or omits a required part.
    """
    document = mapping.document
    required = ((mapping.joints, "hinge", hinges), (mapping.commands, "motor", motors))
    for angles, what, known in required:
        path: tuple[str, ...] = (angles.role, "names")
        listed = (*angles.links, *angles.absent)
        _check_known(document, path, listed, what, known)
        if missing := [name for name in known if name not in listed]:
            advice = (
                f", with {NONE!r} for a hinge without an encoder" if angles.role == "joints" else ""
            )
            raise document.error(
                path,
                f"[{'.'.join(path)}] must list every {what} of the robot, and lacks "
                f"{', '.join(missing)}: add a line for each{advice}",
            )
    parts: tuple[tuple[tuple[str, ...], Collection[str], str, Sequence[str]], ...] = (
        (("joints", "velocities"), mapping.joints.velocities, "hinge", hinges),
        (("joints", "efforts"), mapping.joints.efforts, "hinge", hinges),
        (("touch",), mapping.touch, "touch sensor", touches),
        (("sensors",), mapping.sensors, "sensor", sensors),
    )
    for path, columns, what, known in parts:
        _check_known(document, path, columns, what, known)


def _check_known(
    document: Document,
    path: tuple[str, ...],
    parts: Collection[str],
    what: str,
    known: Sequence[str],
) -> None:
    for name in parts:
        if name not in known:
            raise document.unknown((*path, name), f"{what} of the robot", name, known)


def fitting(bag: Bag, kind: RoleKind) -> list[str]:
    """Returns the topics of a bag that can play a role."""
    return [topic.name for topic in bag.topics.values() if topic.type in TYPES[kind]]


def check_topics(mapping: RecordingMapping, bag: Bag) -> None:
    """Checks that each topic of a mapping exists, has a suitable type, and has messages.

    Raises:
        InputError: A check failed.
    """
    for role in mapping.roles:
        path, known = (*role.path, "topic"), fitting(bag, role.kind)
        if role.topic not in bag.topics:
            raise mapping.document.unknown(
                path, "topic of the bag", role.topic, known or sorted(bag.topics)
            )
        topic = bag.topics[role.topic]
        if topic.type not in TYPES[role.kind]:
            raise mapping.document.error(
                path,
                f"expected a topic of {' or '.join(TYPES[role.kind])} for {role.name}, got "
                f"{topic.name} of {topic.type or 'no type'}: name one that fits, of "
                f"{', '.join(known) or 'which the bag has none'}",
            )
        if not topic.count:
            raise mapping.document.error(
                path, f"expected messages on {topic.name}, got none: name another topic"
            )
        _check_columns_are_named(mapping, role, topic.type)


def _check_columns_are_named(mapping: RecordingMapping, role: Role, kind: str) -> None:
    """Checks that the columns of a Float64MultiArray, and of no other type, have names."""
    if role.kind == "commands":
        key, given = "order", bool(mapping.commands.order)
    elif role.kind == "touch":
        key, given = "index", bool(mapping.touch[role.path[-1]].column)
    else:
        return
    if kind == ARRAY and not given:
        raise mapping.document.error(
            role.path,
            f"{role.topic} has numbers without names ({ARRAY}): add {key} to "
            f"[{role.name}], which names them",
        )
    if kind != ARRAY and given:
        raise mapping.document.error(
            (*role.path, key),
            f"{key} is for topics of {ARRAY}, got one of {kind} on {role.topic}: remove it",
        )


def check_columns(mapping: RecordingMapping, series: Mapping[str, Series]) -> None:
    """Checks that each name of a mapping occurs on its topic.

    Raises:
        InputError: A name does not.
    """
    order = mapping.commands.order
    width = len(series[mapping.commands.topic].columns)
    if order and len(order) != width:
        raise mapping.document.error(
            ("commands", "order"),
            f"order must name the {width} numbers of a message on {mapping.commands.topic}, got "
            f"{len(order)} names",
        )
    for angles in (mapping.joints, mapping.commands):
        columns = series[angles.topic].columns
        known = angles.order or tuple(columns)
        for part, link in angles.links.items():
            if link.name not in known:
                error = unknown_name(f"joint on {angles.topic}", link.name, known)
                lost = f"; {NONE!r} is for a hinge without an encoder"
                raise mapping.document.error(
                    (angles.role, "names", part),
                    f"{error}{lost if angles.role == 'joints' else ''}",
                )
    for name, touch in mapping.touch.items():
        columns = series[touch.topic].columns
        if touch.column not in columns:
            raise mapping.document.unknown(
                ("touch", name, "index"), f"number on {touch.topic}", touch.column, columns
            )


def check_table(mapping: RecordingMapping, names: Collection[str]) -> None:
    """Checks that a table has each column of a mapping.

    Args:
        mapping: Mapping of a table.
        names: Columns of the table.

    Raises:
        InputError: A column is missing.
    """
    for path, name in mapping.columns:
        if name not in names:
            raise mapping.document.unknown(path, "column of the table", name, names)
