"""Suggestion of a mapping from the topics of a bag."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from selfmodel.logs.recordings.mapping.checks import TYPES
from selfmodel.logs.recordings.mapping.likeness import NameMatch, matched
from selfmodel.logs.recordings.mapping.mapping import NONE, UNKNOWN, RoleKind
from selfmodel.logs.recordings.mapping.quoting import escaped, key, quoted
from selfmodel.logs.recordings.rosbag.bag import Bag, read_bag
from selfmodel.logs.recordings.rosbag.message_types import (
    ARRAY,
    ENCODINGS,
    JOINT_STATE,
    NUMBERS,
    ODOMETRY,
    WRENCH,
)
from selfmodel.logs.recordings.series import Series, Topic
from selfmodel.robot.robot import Robot

_COMMANDED = ("command", "cmd", "target", "desired", "setpoint", "goal", "reference")


def suggest_for_bag(path: Path, robot: Robot) -> Iterator[str]:
    """Yields the lines of a suggested mapping of a bag, without its robot.

    Args:
        path: Folder or file of the bag.
        robot: Robot of the recording.

    Raises:
        LogError: The bag is damaged.
        InputError: The bag cannot be read.
    """
    bag = read_bag(path, ())
    hinges, motors = robot.anatomy.hinges, robot.anatomy.motors
    joints, commands = _able(bag, "joints"), _able(bag, "commands")
    series = read_bag(path, {topic.name for topic in (*joints, *commands)}).series
    joints = [topic for topic in joints if not _is_command(topic)]
    joints.sort(key=lambda topic: -_fit(series[topic.name], hinges))
    commands = [topic for topic in commands if topic not in joints[:1]]
    commands.sort(key=lambda topic: (not _is_command(topic), -_fit(series[topic.name], motors)))
    yield 'clock = "header"  # or "log", if the time stamps are of another clock'
    yield from TRIAL_LINES
    yield from _angles("joints", joints, series, hinges, ())
    yield ""
    yield from _angles("commands", commands, series, motors, _names(series, joints[:1]))
    yield ""
    yield from _base(bag)
    yield from _imu(bag)
    yield from _touches(bag, [s.name for s in robot.anatomy.sensors if s.kind == "touch"])


TRIAL_LINES = (
    "# start = 0.0      # s after the first moment at which every role has data",
    "# duration = 10.0  # s",
    "",
)
"""Lines of a mapping between its clock and its roles."""


def _able(bag: Bag, kind: RoleKind) -> list[Topic]:
    """Topics that can play a role, in the order of the role's types."""
    able = [
        topic
        for topic in bag.topics.values()
        if topic.type in TYPES[kind] and topic.encoding in ENCODINGS and topic.count
    ]
    return sorted(able, key=lambda topic: TYPES[kind].index(topic.type))


def _is_command(topic: Topic) -> bool:
    return topic.type != JOINT_STATE or any(word in topic.name.lower() for word in _COMMANDED)


def _fit(series: Series, parts: Sequence[str]) -> int:
    """Number of parts of the robot with a matching name on a topic."""
    if series.topic.type == ARRAY:
        return len(parts) if len(series.columns) == len(parts) else 0
    return len(matched(parts, list(series.columns)))


def _names(series: Mapping[str, Series], topics: Sequence[Topic]) -> tuple[str, ...]:
    return tuple(name for topic in topics for name in series[topic.name].columns)


def _angles(
    table: str,
    topics: Sequence[Topic],
    series: Mapping[str, Series],
    parts: Sequence[str],
    order: tuple[str, ...],
) -> Iterator[str]:
    """Table of the joints or of the commands.

    Args:
        table: Name of the table.
        topics: Topics that can play the role, most likely first.
        series: Messages by topic.
        parts: Hinges or motors of the robot.
        order: Likely names of the columns of a Float64MultiArray, in order.
    """
    yield f"[{table}]"
    yield _topic(topics)
    yield 'unit = "rad"  # CHECK: rad or deg'
    offered: tuple[str, ...] = ()
    if topics:
        offered = _names(series, topics[:1])
        if topics[0].type == ARRAY:
            offered = _order(len(offered), order)
            yield f"order = [{', '.join(map(quoted, offered))}]  # CHECK: the bag has no names"
    yield f"[{table}.names]  # each may also be {{ name = ..., sign = -1, offset = 0.1 }}"
    found = matched(parts, offered)
    used = {guess.name for guess in found.values()}
    all_used = table == "joints" and bool(found) and used.issuperset(offered)
    for part in parts:
        if part not in found and all_used:
            yield f'{key(part)} = "{NONE}"  # CHECK: no encoder: the bag has no other joint'
        else:
            yield f"{key(part)} = {_link(found.get(part), offered)}"


def _order(width: int, order: tuple[str, ...]) -> tuple[str, ...]:
    return order if len(order) == width else tuple(f"column_{k}" for k in range(width))


def _link(guess: NameMatch | None, offered: Sequence[str]) -> str:
    if guess is None:
        known = ", ".join(map(escaped, offered)) or "nothing"
        return f'"{UNKNOWN}"  # CHANGE: the bag has {known}'
    return quoted(guess.name) + ("" if guess.sure else "  # CHECK: not sure")


def _topic(topics: Sequence[Topic]) -> str:
    if not topics:
        return f'topic = "{UNKNOWN}"  # CHANGE: the bag has none of a type that fits'
    others = ", ".join(escaped(topic.name) for topic in topics[1:])
    return f"topic = {quoted(topics[0].name)}" + (f"  # CHECK: or {others}" if others else "")


def _base(bag: Bag) -> Iterator[str]:
    topics = _able(bag, "base")
    if not topics:
        yield "# No topic has the position of the base: the trial has no displacement."
        yield ""
        return
    yield "[base]"
    yield _topic(topics)
    yield 'frame = "start"'
    yield 'unit = "m"'
    if topics[0].type != ODOMETRY:
        yield "# It has no velocities, and none are derived."
    yield ""


def _imu(bag: Bag) -> Iterator[str]:
    if topics := _able(bag, "imu"):
        yield "[imu]  # CHECK: its axes must be those of the root body"
        yield _topic(topics)
        yield ""


def _touches(bag: Bag, sensors: Sequence[str]) -> Iterator[str]:
    topics = {
        topic.name: topic for topic in _able(bag, "touch") if topic.type in (WRENCH, *NUMBERS)
    }
    found = matched(sensors, list(topics))
    for sensor in sensors:
        if sensor not in found:
            yield f"# No topic is similar to {escaped(sensor)}: it is not observed."
            continue
        topic = topics[found[sensor].name]
        unsure = "" if found[sensor].sure else "  # CHECK: not sure"
        yield f"[touch.{key(sensor)}]"
        yield f"topic = {quoted(topic.name)}{unsure}"
        if not topic.type.endswith("Bool"):
            yield "threshold = 5.0  # CHECK: it reads 1 above this"
        yield ""
