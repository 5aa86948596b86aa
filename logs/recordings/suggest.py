"""Suggestion of a mapping from a recording and a robot.

Comments mark uncertain entries: ``CHECK`` marks a guess, ``CHANGE`` an entry to fill in.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from selfmodel.errors import listed
from selfmodel.logs.recordings.bags import read_bag
from selfmodel.logs.recordings.mapping import NONE, UNKNOWN
from selfmodel.logs.recordings.messages import ARRAY, JOINT_STATE, NUMBERS, ODOMETRY, TYPES, WRENCH
from selfmodel.logs.recordings.names import (
    UNITREE,
    UNITREE_LEGS,
    classified,
    elements,
    is_command,
    is_touch,
    matched,
    quantity_of,
    unit_of_time,
)
from selfmodel.logs.recordings.recording import TABLE, Recording, Series
from selfmodel.logs.recordings.tables import is_table, read_table
from selfmodel.robot.robot import Robot
from selfmodel.trials.trajectory import PREFIXES, column_names

_UNSURE = "  # CHECK: not sure"

_LONGEST_PERIODS = {"s": 0.5, "ms": 500.0, "us": 5e5}
"""Longest usual period of the rows that is assumed of each unit of time."""

Match = tuple[str, bool]
"""Name in a recording, and whether it is certain."""


@dataclass(frozen=True)
class _Offer:
    """What a recording offers for a mapping.

    Attributes:
        what: Word for the recording.
        heads: First lines of tables of the mapping; one without lines is left out.
        names: Names by quantity and label, which may be a joint's.
        touches: Lines of the table of a touch sensor, by names that may be of one.
        known: All names of a table.
        notes: Warnings about the recording.
        period: Usual time between two commands, s; 0 if unknown.
    """

    what: str
    heads: Mapping[str, Sequence[str]]
    names: Mapping[str, Mapping[str, str]]
    touches: Mapping[str, Sequence[str]]
    known: Sequence[str] = field(default=())
    notes: Sequence[str] = field(default=())
    period: float = 0.0


def suggest(path: Path, robot: Robot, name: str, *, with_timestep: bool) -> str:
    """Returns the suggestion of a mapping of a bag or a table, as TOML.

    The name is that of the robot in the mapping, or its MJCF or URDF file.
    """
    offer = _in_table(path, robot) if is_table(path) else _in_bag(read_bag(path), robot)
    physics = float(robot.model.opt.timestep)
    step = max(robot.control_timestep, round(physics * round(offer.period / physics), 9))
    lines = [
        "# A suggestion. CHECK marks a guess; CHANGE must be filled in before it can be used.",
        *(f"# Note: {escaped(note)}." for note in offer.notes),
        f"robot = {quoted(name)}",
        *[f"control_timestep = {step!r}  # s; CHECK: how often the robot is commanded"]
        * with_timestep,
        '# controller = "gait.npz"  # controller of the robot, if known',
        '# stage = "before"  # of the healthy robot',
        *offer.heads.get("", ()),
        "# start = 0.0      # s after the first moment at which every role has data",
        "# duration = 10.0  # s",
        "",
        *_lines(offer, robot),
    ]
    return "\n".join(lines).rstrip() + "\n"


def _lines(offer: _Offer, robot: Robot) -> Iterator[str]:
    anatomy, names = robot.anatomy, offer.names
    yield from _table(offer, "time")
    yield f"[joints]\n{_text(offer.heads['joints'])}"
    yield from _all_parts(offer, "joints", "position", anatomy.hinges)
    yield from _some_parts("joints.velocities", anatomy.hinges, names.get("velocity", {}))
    yield from _some_parts("joints.efforts", anatomy.hinges, names.get("effort", {}))
    yield f"\n[commands]\n{_text(offer.heads['commands'])}"
    yield from _all_parts(offer, "commands", "command", anatomy.motors)
    yield ""
    if offer.heads["base"]:
        yield from _table(offer, "base")
    else:
        yield f"# The {offer.what} has no position of the base: the trial has no displacement.\n"
    yield from _table(offer, "imu", "  # CHECK: its axes must be those of the root body")
    sensors = names.get("sensor", {})
    certain = {k: v for k, v in _matched(anatomy.names.sensors, sensors).items() if v[1]}
    if certain:
        yield "[sensors]"
        yield from (_entry(part, *found) for part, found in certain.items())
    if not sensors:
        yield from _touches(offer, [s.name for s in anatomy.sensors if s.kind == "touch"])


def _table(offer: _Offer, name: str, comment: str = "") -> Iterator[str]:
    if lines := offer.heads.get(name):
        yield f"[{name}]{comment}\n{_text(lines)}\n"


def _text(lines: Sequence[str]) -> str:
    return "\n".join(lines)


def _all_parts(offer: _Offer, role: str, quantity: str, parts: Sequence[str]) -> Iterator[str]:
    yield f"[{role}.names]  # each may also be {{ name = ..., sign = -1, offset = 0.1 }}"
    offered = offer.names.get(quantity, {})
    matches = _matched(parts, offered)
    used = {name for name, _ in matches.values()}
    rest = [name for name in offered.values() if name not in used]
    for part in parts:
        if part in matches:
            yield _entry(part, *matches[part])
        elif role == "joints" and matches and not rest:
            yield f'{key(part)} = "{NONE}"  # CHECK: no encoder: no other angle is left'
        else:
            known = _listed(rest or offer.known or list(offered.values()))
            yield f'{key(part)} = "{UNKNOWN}"  # CHANGE: the {offer.what} has {known}'


def _some_parts(table: str, parts: Sequence[str], offered: Mapping[str, str]) -> Iterator[str]:
    """Table of the parts that match a name, surely or not."""
    if matches := _matched(parts, offered):
        yield f"[{table}]"
        yield from (_entry(part, *match) for part, match in matches.items())


def _matched(parts: Sequence[str], offered: Mapping[str, str]) -> dict[str, Match]:
    """Name for each part: by the names of ``logs export``, by number, or by similarity."""
    exported = {f"{prefix}.{part}": part for prefix in PREFIXES.values() for part in parts}
    exact = {exported[name]: name for name in offered.values() if name in exported}
    if len(exact) == len(parts) or (exact and len(exact) == len(offered)):
        return {part: (exact[part], True) for part in parts if part in exact}
    labels = [label for label in offered if label.isdecimal()]
    if len(labels) == len(offered) == len(parts):
        ordered = sorted(labels, key=int)
        return {part: (offered[k], False) for part, k in zip(parts, ordered, strict=True)}
    matches = matched(parts, list(offered))
    return {part: (offered[label], sure) for part, (label, sure) in matches.items()}


def _touches(offer: _Offer, sensors: Sequence[str]) -> Iterator[str]:
    matches = matched(sensors, list(offer.touches))
    where = "topic" if offer.what == "bag" else "column"
    for sensor in sensors:
        if sensor not in matches:
            yield f"# No {where} is similar to {escaped(sensor)}: it is not observed."
            continue
        name, sure = matches[sensor]
        first, *others = offer.touches[name]
        yield f"[touch.{key(sensor)}]\n{first}{'' if sure else _UNSURE}\n{_text([*others, ''])}"


# ---------------------------------------------------------------- bags


def _in_bag(bag: Recording, robot: Robot) -> _Offer:
    series, hinges, motors = bag.series, robot.anatomy.hinges, robot.anatomy.motors

    def able(role: str) -> list[str]:
        """Topics that can play a role, in the order of the role's types."""
        topics = [name for name, found in series.items() if found.type in TYPES[role]]
        topics = [topic for topic in topics if series[topic].count]
        return sorted(topics, key=lambda topic: TYPES[role].index(series[topic].type))

    def commands_only(topic: str) -> bool:
        return series[topic].type != JOINT_STATE or is_command(topic)

    joints = [topic for topic in able("joints") if not commands_only(topic)]
    joints.sort(key=lambda topic: -_fit(series[topic], hinges))
    commands = [topic for topic in able("commands") if topic not in joints[:1]]
    commands.sort(key=lambda topic: (not commands_only(topic), -_fit(series[topic], motors)))
    names = {"position": {name: name for topic in joints[:1] for name in series[topic].names}}
    commanded = [name for topic in commands[:1] for name in series[topic].names]
    order = []
    if commands and series[commands[0]].type == ARRAY:
        if len(names["position"]) == len(commanded):
            commanded = list(names["position"])
        else:
            commanded = [f"column_{k}" for k in range(len(commanded))]
        listed_names = ", ".join(map(quoted, commanded))
        order = [f"order = [{listed_names}]  # CHECK: the bag has no names"]
    names["command"] = {name: name for name in commanded}
    tables = sorted((t for t in series if series[t].by_place), key=lambda t: -series[t].count)
    lists = _lists([(topic, series[topic]) for topic in tables], robot)
    if "position" in lists and not any(_fit(series[topic], hinges) for topic in joints[:1]):
        topic, names["position"] = lists["position"]
        joints = [topic]
        names |= {q: lists[q][1] for q in ("velocity", "effort") if lists.get(q, [""])[0] == topic}
    if "command" in lists and not any(_fit(series[topic], motors) for topic in commands[:1]):
        topic, names["command"] = lists["command"]
        commands, order = [topic], []
    base, imu, unit = able("base"), able("imu"), 'unit = "rad"  # CHECK: rad or deg'
    of_base = [_topic(base), 'frame = "start"', 'unit = "m"'] if base else []
    if base and series[base[0]].type != ODOMETRY:
        of_base.append("# It has no velocities, and none are derived.")
    of_imu = [_topic(imu)] if imu else []
    for topic in tables:
        vectors = classified(series[topic].names).vectors["imu"]
        of_imu = of_imu or [_topic([topic]), *_vectors(vectors)] if vectors else of_imu
    sent = [series[topic].logged for topic in commands[:1] if len(series[topic].logged) > 1]
    return _Offer(
        what="bag",
        notes=bag.notes,
        period=float(np.median(np.diff(sent[0]))) / 1e9 if sent else 0.0,
        heads={
            "": ['clock = "header"  # or "log", if the time stamps are of another clock'],
            "joints": [_topic(joints), unit],
            "commands": [_topic(commands), unit, *order],
            "base": of_base,
            "imu": of_imu,
        },
        names=names,
        touches={
            topic: [f"topic = {quoted(topic)}", *_threshold(5.0, series[topic].type)]
            for topic in able("touch")
            if series[topic].type == WRENCH or (series[topic].type in NUMBERS and is_touch(topic))
        }
        | {
            label: [f"topic = {quoted(topic)}", f"column = {quoted(name)}", *_threshold(20.0)]
            for topic, columns in [lists[q] for q in ("touch",) if q in lists]
            for label, name in columns.items()
        },
    )


def _threshold(value: float, kind: str = "") -> list[str]:
    """Line of a touch sensor's threshold; a Bool needs none."""
    return [] if kind.endswith("Bool") else [f"threshold = {value}  # CHECK: it reads 1 above this"]


def _lists(
    tables: Sequence[tuple[str, Series]], robot: Robot
) -> dict[str, tuple[str, dict[str, str]]]:
    """Topic and columns of lists in messages by quantity, with a label for each element.

    The elements are those of Unitree's joints and feet, or else those of the robot's parts in
    order.
    """
    found: dict[str, tuple[str, dict[str, str]]] = {}
    for topic, series in tables:
        is_unitree = series.type.startswith(("unitree_go/", "unitree_legged_msgs/"))
        for (name, field_name), columns in elements(series.names).items():
            quantity = quantity_of(field_name or name)
            if is_command(f"{topic}.{name}"):
                quantity = "command" if quantity == "position" else ""
            elif is_unitree and is_touch(name):
                quantity = "touch"
            parts = robot.anatomy.motors if quantity == "command" else robot.anatomy.hinges
            labels = UNITREE if is_unitree else tuple(str(place) for place in range(len(parts)))
            if quantity == "touch":
                labels = tuple(f"{leg}_foot" for leg in UNITREE_LEGS)
            if quantity and len(columns) >= len(labels):
                found.setdefault(quantity, (topic, dict(zip(labels, columns, strict=False))))
    return found


def _fit(series: Series, parts: Sequence[str]) -> int:
    if series.type == ARRAY:
        return len(parts) if len(series.names) == len(parts) else 0
    return len(matched(parts, series.names))


def _topic(topics: Sequence[str]) -> str:
    if not topics:
        return f'topic = "{UNKNOWN}"  # CHANGE: the bag has none of a type that fits'
    others = ", ".join(map(escaped, topics[1:]))
    return f"topic = {quoted(topics[0])}" + (f"  # CHECK: or {others}" if others else "")


# ---------------------------------------------------------------- tables


def _in_table(path: Path, robot: Robot) -> _Offer:
    names = read_table(path, ()).series[TABLE].names
    columns = classified(names)
    anatomy, parts = robot.anatomy, dict(columns.parts)
    if "position" not in parts:  # columns that are called like a hinge, without a quantity
        similar = matched(anatomy.hinges, columns.others).values()
        parts["position"] = {name: name for name, sure in similar if sure}
    degrees = any("deg" in name.lower() for name in columns.parts.get("position", {}).values())
    exported = set(column_names(anatomy.names, "base_position")) <= set(names)
    base, of_base = columns.vectors["base"], []
    if base.keys() & {"position", "orientation"}:
        frame = "recorded" if exported else "start"
        of_base = [
            *_vectors(base),
            f'frame = "{frame}"  # start: begin at x = y = 0 heading along +x; or recorded',
            'unit = "m"',
        ]
        if "linear_velocity" in base:
            check = "" if exported else "  # CHECK: world or base"
            of_base.append(f'velocity_frame = "world"{check}')
    return _Offer(
        what="table",
        heads={
            "time": _time(path, columns.times, names),
            "joints": ['unit = "deg"' if degrees else 'unit = "rad"  # CHECK: rad or deg'],
            "commands": [
                'unit = "rad"  # CHECK: rad or deg; raw for a motor that is no position servo'
            ],
            "base": of_base,
            "imu": _vectors(columns.vectors["imu"]),
        },
        names=parts,
        touches={
            name: [f"column = {quoted(name)}", *_threshold(0.5)]
            for name in columns.others
            if is_touch(name)
        },
        known=names,
    )


def _time(path: Path, times: Sequence[str], names: Sequence[str]) -> list[str]:
    check = "  # CHECK: s, ms, us or ns"
    if not times:
        known = _listed(names)
        return [f'column = "{UNKNOWN}"  # CHANGE: the table has {known}', f'unit = "s"{check}']
    name, unit = times[0], unit_of_time(times[0])
    others = f"  # CHECK: or {_listed(times[1:])}" if times[1:] else ""
    if unit:
        check = ""
    else:
        values = read_table(path, {name}, time=name).series[TABLE].columns[name].values[:, 0]
        usual = float(np.median(np.abs(np.diff(values)))) if len(values) > 1 else 0.0
        unit = next((unit for unit, most in _LONGEST_PERIODS.items() if usual <= most), "ns")
    return [f"column = {quoted(name)}{others}", f"unit = {quoted(unit)}{check}"]


def _vectors(vectors: Mapping[str, Sequence[str]]) -> list[str]:
    lines = []
    for quantity, columns in vectors.items():
        order = (
            "  # CHECK: w, x, y, z"
            if len(columns) == 4 and "w" not in columns[0].lower()[-2:]
            else ""
        )
        lines.append(f"{quantity} = [{', '.join(map(quoted, columns))}]{order}")
    return lines


# ---------------------------------------------------------------- TOML


def _entry(name: str, value: str, sure: bool) -> str:  # noqa: FBT001  # of a match
    return f"{key(name)} = {quoted(value)}" + ("" if sure else _UNSURE)


def _listed(names: Sequence[str]) -> str:
    return listed([escaped(name) for name in names], 50)


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
