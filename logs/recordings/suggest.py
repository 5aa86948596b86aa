"""Suggestion of a mapping from a recording and a robot.

Comments mark uncertain entries: ``CHECK`` marks a guess, ``CHANGE`` an entry to fill in.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from selfmodel.logs.recordings.bags import read_bag
from selfmodel.logs.recordings.checks import TYPES
from selfmodel.logs.recordings.mapping import NONE, UNKNOWN
from selfmodel.logs.recordings.messages import ARRAY, JOINT_STATE, NUMBERS, ODOMETRY, WRENCH
from selfmodel.logs.recordings.names import classified, matched, unit_of_time
from selfmodel.logs.recordings.recording import Recording, Series
from selfmodel.logs.recordings.tables import NO_TIME, is_table, read_table
from selfmodel.robot.robot import Robot
from selfmodel.trials.behaviour import PREFIXES, column_names

_COMMANDED = ("command", "cmd", "target", "desired", "setpoint", "goal", "reference")

_LONGEST_PERIODS = {"s": 0.5, "ms": 500.0, "us": 5e5}
"""Longest usual period of the rows that is assumed of each unit of time."""

_MOST_LISTED = 50


def suggest(path: Path, robot: Robot, name: str, *, with_timestep: bool) -> str:
    """Returns the suggestion of a mapping, as TOML.

    Args:
        path: Folder or file of a bag, or a table.
        robot: Robot of the recording.
        name: Name of the robot in the mapping, or its MJCF or URDF file.
        with_timestep: Whether the mapping must contain the control time step.

    Raises:
        InputError: The recording is damaged, or cannot be read.
    """
    offer = _in_table(path, robot) if is_table(path) else _in_bag(read_bag(path), robot)
    return "\n".join(_lines(offer, robot, name, with_timestep=with_timestep)).rstrip() + "\n"


@dataclass(frozen=True)
class _Offer:
    """What a recording offers for a mapping, as lines or by name.

    Attributes:
        what: Word for the recording.
        heads: First lines of the tables of the joints and of the commands.
        names: Names by quantity and label, which may be a joint's.
        known: Names to list where none fits.
        touches: Thresholds by names that may be of touch sensors; None for a Bool.
        base: Lines of the table of the base.
        imu: Lines of the table of the IMU.
        clock: Line of the clock of a bag.
        time: Table of the time of a table.
    """

    what: str
    heads: Mapping[str, Sequence[str]]
    names: Mapping[str, Mapping[str, str]]
    known: Mapping[str, Sequence[str]]
    touches: Mapping[str, float | None]
    base: Sequence[str]
    imu: Sequence[str]
    clock: Sequence[str] = ()
    time: Sequence[str] = ()


def _lines(offer: _Offer, robot: Robot, name: str, *, with_timestep: bool) -> Iterator[str]:
    anatomy = robot.anatomy
    yield "# A suggestion. CHECK marks a guess; CHANGE must be filled in before it can be used."
    yield f"robot = {quoted(name)}"
    if with_timestep:
        step = repr(robot.control_timestep)
        yield f"control_timestep = {step}  # s; CHECK: how often the robot is commanded"
    yield '# controller = "gait.npz"  # controller of the robot, if known'
    yield '# stage = "before"  # of the healthy robot'
    yield from offer.clock
    yield "# start = 0.0      # s after the first moment at which every role has data"
    yield "# duration = 10.0  # s"
    yield ""
    yield from offer.time
    for role, quantity, parts in (
        ("joints", "position", anatomy.hinges),
        ("commands", "command", anatomy.motors),
    ):
        yield f"[{role}]"
        yield from offer.heads[role]
        yield from _all_parts(offer, role, quantity, parts)
        if role == "joints":
            yield from _some_parts("joints.velocities", parts, offer.names.get("velocity", {}))
            yield from _some_parts("joints.efforts", parts, offer.names.get("effort", {}))
        yield ""
    if offer.base:
        yield "[base]"
        yield from offer.base
    else:
        yield f"# The {offer.what} has no position of the base: the trial has no displacement."
    yield ""
    if offer.imu:
        yield "[imu]  # CHECK: its axes must be those of the root body"
        yield from offer.imu
        yield ""
    sensors = offer.names.get("sensor", {})
    yield from _some_parts("sensors", anatomy.names.sensors, sensors, sure=True)
    if not sensors:
        yield from _touches(offer, [s.name for s in anatomy.sensors if s.kind == "touch"])


def _all_parts(offer: _Offer, role: str, quantity: str, parts: Sequence[str]) -> Iterator[str]:
    """Table of all hinges or motors."""
    yield f"[{role}.names]  # each may also be {{ name = ..., sign = -1, offset = 0.1 }}"
    offered = offer.names.get(quantity, {})
    found = _matched(parts, offered)
    used = {name for name, _ in found.values()}
    rest = [name for name in offered.values() if name not in used]
    for part in parts:
        if part in found:
            yield _entry(part, *found[part])
        elif role == "joints" and found and not rest:
            yield f'{key(part)} = "{NONE}"  # CHECK: no encoder: no other angle is left'
        else:
            known = _listed(rest or offer.known[role])
            yield f'{key(part)} = "{UNKNOWN}"  # CHANGE: the {offer.what} has {known}'


def _some_parts(
    table: str, parts: Sequence[str], offered: Mapping[str, str], *, sure: bool = False
) -> Iterator[str]:
    """Table of some parts: those that match a name, surely or not."""
    found = _matched(parts, offered)
    lines = [
        _entry(part, name, certain)
        for part, (name, certain) in found.items()
        if certain or not sure
    ]
    if lines:
        yield f"[{table}]"
        yield from lines


def _matched(parts: Sequence[str], offered: Mapping[str, str]) -> dict[str, tuple[str, bool]]:
    """Name for each part, and whether the match is certain: by name, else by number."""
    # The columns of ``logs export``.
    own = {f"{prefix}.{part}": part for prefix in PREFIXES.values() for part in parts}
    exact = {own[name]: name for name in offered.values() if name in own}
    if len(exact) == len(parts) or (exact and len(exact) == len(offered)):
        return {part: (exact[part], True) for part in parts if part in exact}
    labels = [label for label in offered if label.isdecimal()]
    if len(labels) == len(offered) == len(parts):
        ordered = sorted(labels, key=int)
        return {part: (offered[k], False) for part, k in zip(parts, ordered, strict=True)}
    matches = matched(parts, list(offered))
    return {part: (offered[label], sure) for part, (label, sure) in matches.items()}


def _touches(offer: _Offer, sensors: Sequence[str]) -> Iterator[str]:
    found = matched(sensors, list(offer.touches))
    where = "topic" if offer.what == "bag" else "column"
    for sensor in sensors:
        if sensor not in found:
            yield f"# No {where} is similar to {escaped(sensor)}: it is not observed."
            continue
        name, sure = found[sensor]
        yield f"[touch.{key(sensor)}]"
        yield _entry(where, name, sure)
        if (threshold := offer.touches[name]) is not None:
            yield f"threshold = {threshold}  # CHECK: it reads 1 above this"
        yield ""


# ---------------------------------------------------------------- bags


def _in_bag(bag: Recording, robot: Robot) -> _Offer:
    hinges, motors = robot.anatomy.hinges, robot.anatomy.motors
    series = bag.series

    def able(role: str) -> list[str]:
        """Topics that can play a role, in the order of the role's types."""
        types = TYPES[role]
        topics = [topic for topic, found in series.items() if found.type in types and found.count]
        return sorted(topics, key=lambda topic: types.index(series[topic].type))

    joints = [topic for topic in able("joints") if not _is_command(topic, series[topic])]
    joints.sort(key=lambda topic: -_fit(series[topic], hinges))
    commands = [topic for topic in able("commands") if topic not in joints[:1]]
    commands.sort(
        key=lambda topic: (not _is_command(topic, series[topic]), -_fit(series[topic], motors))
    )
    encoders = [name for topic in joints[:1] for name in series[topic].names]
    commanded = [name for topic in commands[:1] for name in series[topic].names]
    heads = {
        role: [_topic(topics), 'unit = "rad"  # CHECK: rad or deg']
        for role, topics in (("joints", joints), ("commands", commands))
    }
    if commands and series[commands[0]].type == ARRAY:
        width = len(commanded)
        commanded = encoders if len(encoders) == width else [f"column_{k}" for k in range(width)]
        order = ", ".join(map(quoted, commanded))
        heads["commands"].append(f"order = [{order}]  # CHECK: the bag has no names")
    base, imu = able("base"), able("imu")
    return _Offer(
        what="bag",
        clock=['clock = "header"  # or "log", if the time stamps are of another clock'],
        heads=heads,
        names={
            "position": {name: name for name in encoders},
            "command": {name: name for name in commanded},
        },
        known={"joints": encoders, "commands": commanded},
        base=[_topic(base), 'frame = "start"', 'unit = "m"', *_pose_only(series[base[0]])]
        if base
        else [],
        imu=[_topic(imu)] if imu else [],
        touches={
            topic: None if series[topic].type.endswith("Bool") else 5.0
            for topic in able("touch")
            if series[topic].type in (WRENCH, *NUMBERS)
        },
    )


def _is_command(topic: str, series: Series) -> bool:
    return series.type != JOINT_STATE or any(word in topic.lower() for word in _COMMANDED)


def _fit(series: Series, parts: Sequence[str]) -> int:
    """Number of parts of the robot with a matching name on a topic."""
    if series.type == ARRAY:
        return len(parts) if len(series.names) == len(parts) else 0
    return len(matched(parts, series.names))


def _pose_only(series: Series) -> list[str]:
    return [] if series.type == ODOMETRY else ["# It has no velocities, and none are derived."]


def _topic(topics: Sequence[str]) -> str:
    if not topics:
        return f'topic = "{UNKNOWN}"  # CHANGE: the bag has none of a type that fits'
    others = ", ".join(map(escaped, topics[1:]))
    return f"topic = {quoted(topics[0])}" + (f"  # CHECK: or {others}" if others else "")


# ---------------------------------------------------------------- tables


def _in_table(path: Path, robot: Robot) -> _Offer:
    names = read_table(path, ()).names
    found = classified(names)
    anatomy = robot.anatomy
    parts = dict(found.parts)
    if "position" not in parts:  # columns that are called like a hinge, without a quantity
        similar = matched(anatomy.hinges, found.others).values()
        parts["position"] = {name: name for name, sure in similar if sure}
    degrees = any("deg" in name.lower() for name in found.parts.get("position", {}).values())
    exported = set(column_names(anatomy.names, "base_position")) <= set(names)
    base = found.vectors["base"]
    pose = []
    if base.keys() & {"position", "orientation"}:
        frame = "recorded" if exported else "start"
        pose = [
            *_vectors(base),
            f'frame = "{frame}"  # start: begin at x = y = 0 heading along +x; or recorded',
            'unit = "m"',
        ]
        if "linear_velocity" in base:
            check = "" if exported else "  # CHECK: world or base"
            pose.append(f'velocity_frame = "world"{check}')
    return _Offer(
        what="table",
        time=["[time]", *_time(path, found.times, names), ""],
        heads={
            "joints": ['unit = "deg"' if degrees else 'unit = "rad"  # CHECK: rad or deg'],
            "commands": [
                'unit = "rad"  # CHECK: rad or deg; raw for a motor that is no position servo'
            ],
        },
        names=parts,
        known={"joints": names, "commands": names},
        base=pose,
        imu=_vectors(found.vectors["imu"]),
        touches=dict.fromkeys(found.others, 0.5),
    )


def _time(path: Path, times: Sequence[str], names: Sequence[str]) -> list[str]:
    if not times:
        return [
            f'column = "{UNKNOWN}"  # CHANGE: the table has {_listed(names)}',
            'unit = "s"  # CHECK: s, ms, us or ns',
        ]
    name = times[0]
    others = f"  # CHECK: or {_listed(times[1:])}" if times[1:] else ""
    if unit := unit_of_time(name):
        return [f"column = {quoted(name)}{others}", f"unit = {quoted(unit)}"]
    values = read_table(path, {name}, exact=name).columns[name]
    known = values[np.isfinite(values) & (values != NO_TIME)].astype(np.float64)
    usual = float(np.median(np.abs(np.diff(known)))) if len(known) > 1 else 0.0
    unit = next((unit for unit, most in _LONGEST_PERIODS.items() if usual <= most), "ns")
    return [f"column = {quoted(name)}{others}", f"unit = {quoted(unit)}  # CHECK: s, ms, us or ns"]


def _vectors(vectors: Mapping[str, Sequence[str]]) -> list[str]:
    return [
        f"{quantity} = [{', '.join(map(quoted, columns))}]" for quantity, columns in vectors.items()
    ]


# ---------------------------------------------------------------- TOML


def _entry(name: str, value: str, sure: bool) -> str:  # noqa: FBT001  # of a match
    return f"{key(name)} = {quoted(value)}" + ("" if sure else "  # CHECK: not sure")


def _listed(names: Sequence[str]) -> str:
    shown = ", ".join(map(escaped, names[:_MOST_LISTED])) or "nothing"
    more = len(names) - _MOST_LISTED
    return shown if more <= 0 else f"{shown} and {more} more"


def quoted(text: str) -> str:
    """Returns the TOML string of a text."""
    return f'"{escaped(text)}"'


def escaped(text: str) -> str:
    """Returns a text as in a TOML string or comment; a recording's may have any character."""
    return "".join(
        char if char.isprintable() and char not in '"\\' else f"\\U{ord(char):08X}" for char in text
    )


def key(name: str) -> str:
    """Returns the TOML key of a name."""
    bare = name.replace("_", "").replace("-", "")
    return name if bare.isalnum() and name.isascii() else quoted(name)
