"""Suggestion of a mapping from the columns of a table."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from selfmodel.logs.recordings.mapping.column_words import Classified, classified, unit_in
from selfmodel.logs.recordings.mapping.likeness import matched
from selfmodel.logs.recordings.mapping.mapping import NONE, UNKNOWN
from selfmodel.logs.recordings.mapping.quoting import escaped, key, quoted
from selfmodel.logs.recordings.mapping.suggest_bag import TRIAL_LINES
from selfmodel.logs.recordings.tables.content import NO_TIME
from selfmodel.logs.recordings.tables.table import read_table
from selfmodel.robot.robot import Robot
from selfmodel.trials.behaviour import PREFIXES, column_names

_LONGEST_PERIODS = {"s": 0.5, "ms": 500.0, "us": 5e5}
"""Longest usual period of the rows that is assumed of each unit of time."""

_MOST_LISTED = 50


def suggest_for_table(path: Path, robot: Robot) -> Iterator[str]:
    """Yields the lines of a suggested mapping of a table, without its robot.

    Args:
        path: The table.
        robot: Robot of the recording.

    Raises:
        InputError: The table cannot be read.
    """
    names = read_table(path, ()).names
    found = classified(names)
    anatomy = robot.anatomy
    yield from TRIAL_LINES
    yield from _time(path, found, names)
    yield "[joints]"
    yield f"unit = {_unit(found)}"
    positions = found.parts.get("position") or _similar(anatomy.hinges, found.others)
    yield from _parts("joints.names", anatomy.hinges, positions, names)
    yield from _known("joints.velocities", anatomy.hinges, found.parts.get("velocity", {}))
    yield from _known("joints.efforts", anatomy.hinges, found.parts.get("effort", {}))
    yield ""
    yield "[commands]"
    yield 'unit = "rad"  # CHECK: rad or deg; raw for the unit of a motor that is no position servo'
    yield from _parts("commands.names", anatomy.motors, found.parts.get("command", {}), names)
    yield ""
    yield from _base(found, names, robot)
    if found.imu:
        yield "[imu]  # CHECK: its axes must be those of the root body"
        yield from _vectors(found.imu)
        yield ""
    sensors = anatomy.names.sensors
    yield from _known("sensors", sensors, found.parts.get("sensor", {}), exact=True)
    touches = [s.name for s in anatomy.sensors if s.kind == "touch"]
    if not found.parts.get("sensor"):
        yield from _touches(touches, found.others)


def _time(path: Path, found: Classified, names: Sequence[str]) -> Iterator[str]:
    yield "[time]"
    if not found.times:
        yield f'column = "{UNKNOWN}"  # CHANGE: the table has {_listed(names)}'
        yield 'unit = "s"  # CHECK: s, ms, us or ns'
        yield ""
        return
    name = found.times[0]
    others = f"  # CHECK: or {_listed(found.times[1:])}" if found.times[1:] else ""
    yield f"column = {quoted(name)}{others}"
    unit = unit_in(name)
    if unit:
        yield f"unit = {quoted(unit)}"
    else:
        yield f"unit = {quoted(_guessed_unit(path, name))}  # CHECK: s, ms, us or ns"
    yield ""


def _guessed_unit(path: Path, name: str) -> str:
    times = read_table(path, {name}, exact=name).columns[name]
    known = times[np.isfinite(times) & (times != NO_TIME)].astype(np.float64)
    periods = np.abs(np.diff(known))
    usual = float(np.median(periods)) if len(periods) else 0.0
    return next((unit for unit, most in _LONGEST_PERIODS.items() if usual <= most), "ns")


def _unit(found: Classified) -> str:
    columns = found.parts.get("position", {}).values()
    if any("deg" in name.lower() for name in columns):
        return '"deg"'
    return '"rad"  # CHECK: rad or deg'


def _similar(parts: Sequence[str], names: Sequence[str]) -> Mapping[str, str]:
    """Columns that are called like a part, without the name of a quantity."""
    return {match.name: match.name for match in matched(parts, names).values() if match.sure}


def _parts(
    table: str, parts: Sequence[str], offered: Mapping[str, str], names: Sequence[str]
) -> Iterator[str]:
    """Table of all hinges or motors."""
    yield f"[{table}]  # each may also be {{ name = ..., sign = -1, offset = 0.1 }}"
    found = _matched(parts, offered)
    rest = [name for name in offered.values() if name not in {n for n, _ in found.values()}]
    for part in parts:
        if part in found:
            name, sure = found[part]
            yield f"{key(part)} = {quoted(name)}" + ("" if sure else "  # CHECK: not sure")
        elif table == "joints.names" and found and not rest:
            yield f'{key(part)} = "{NONE}"  # CHECK: no encoder: the table has no other angle'
        else:
            known = _listed(rest or names)
            yield f'{key(part)} = "{UNKNOWN}"  # CHANGE: the table has {known}'


def _known(
    table: str, parts: Sequence[str], offered: Mapping[str, str], *, exact: bool = False
) -> Iterator[str]:
    """Table of some parts, those that match a column."""
    found = _matched(parts, offered)
    if exact:
        found = {part: (name, sure) for part, (name, sure) in found.items() if sure}
    if found:
        yield f"[{table}]"
    for part, (name, sure) in found.items():
        yield f"{key(part)} = {quoted(name)}" + ("" if sure else "  # CHECK: not sure")


def _matched(parts: Sequence[str], offered: Mapping[str, str]) -> dict[str, tuple[str, bool]]:
    """Column of each part, and whether the match is certain: by name, else by number."""
    exact = {part: column for part in parts for column in offered.values() if _is_of(column, part)}
    if len(exact) == len(parts) or (exact and len(exact) == len(offered)):
        return {part: (column, True) for part, column in exact.items()}
    labels = [label for label in offered if label.isdecimal()]
    if len(labels) == len(offered) == len(parts):
        ordered = sorted(labels, key=int)
        return {part: (offered[k], False) for part, k in zip(parts, ordered, strict=True)}
    return {
        part: (offered[match.name], match.sure)
        for part, match in matched(parts, list(offered)).items()
    }


def _is_of(column: str, part: str) -> bool:
    """Whether a column has the name that ``logs export`` gives it."""
    prefix, _, name = column.partition(".")
    return name == part and prefix in PREFIXES.values()


def _base(found: Classified, names: Sequence[str], robot: Robot) -> Iterator[str]:
    if not {"position", "orientation"} & set(found.base):
        yield "# No columns have the position of the base: the trial has no displacement."
        yield ""
        return
    own = set(column_names(robot.anatomy.names, "base_position")) <= set(names)
    yield "[base]"
    yield from _vectors(found.base)
    frame = "recorded" if own else "start"
    yield f'frame = "{frame}"  # start: begin at x = y = 0 heading along +x; or recorded'
    yield 'unit = "m"'
    if "linear_velocity" in found.base:
        yield 'velocity_frame = "world"' + ("" if own else "  # CHECK: world or base")
    yield ""


def _vectors(vectors: Mapping[str, Sequence[str]]) -> Iterator[str]:
    for quantity, columns in vectors.items():
        yield f"{quantity} = [{', '.join(map(quoted, columns))}]"


def _touches(sensors: Sequence[str], others: Sequence[str]) -> Iterator[str]:
    found = matched(sensors, others)
    for sensor in sensors:
        if sensor not in found:
            yield f"# No column is similar to {escaped(sensor)}: it is not observed."
            continue
        unsure = "" if found[sensor].sure else "  # CHECK: not sure"
        yield f"[touch.{key(sensor)}]"
        yield f"column = {quoted(found[sensor].name)}{unsure}"
        yield "threshold = 0.5  # CHECK: it reads 1 above this"
        yield ""


def _listed(names: Sequence[str]) -> str:
    shown = ", ".join(map(escaped, names[:_MOST_LISTED])) or "nothing"
    more = len(names) - _MOST_LISTED
    return shown if more <= 0 else f"{shown} and {more} more"
