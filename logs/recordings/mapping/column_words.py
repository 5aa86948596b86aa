"""Classification of a table's columns by the words of their names."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

from selfmodel.logs.recordings.mapping.likeness import parts_of

Quantity = Literal["command", "velocity", "effort", "sensor", "position"]

_QUANTITIES: Mapping[Quantity, frozenset[str]] = MappingProxyType(
    {
        "command": frozenset(
            (
                *("command", "commands", "cmd", "target", "targets", "desired", "des", "setpoint"),
                *("goal", "reference", "ref", "action", "actions", "ctrl", "control"),
            )
        ),
        "velocity": frozenset(("velocity", "velocities", "vel", "qd", "dq", "qvel", "qdot")),
        "effort": frozenset(("effort", "efforts", "torque", "torques", "tau")),
        "sensor": frozenset(("sensor", "sensors", "reading", "readings")),
        "position": frozenset(
            ("position", "positions", "pos", "q", "qpos", "angle", "angles", "theta")
        ),
    }
)
"""Words of each quantity, in the order of the decision: ``position_target`` is a command."""

_TIMES = frozenset(
    ("time", "t", "timestamp", "stamp", "ts", "elapsed", "epoch", "sec", "secs", "seconds")
)
_UNITS = frozenset(("s", "ms", "us", "ns", "sec"))
_FILLERS = frozenset(("rad", "deg", "degrees", "nm", "joint", "state", "states", "m"))

_VECTORS: Mapping[str, frozenset[str]] = MappingProxyType(
    {
        "orientation": frozenset(["orientation", "quat", "quaternion", "rot", "rotation", "q"]),
        "angular_velocity": frozenset(["angular", "gyro", "omega", "gyroscope"]),
        "linear_velocity": frozenset(["velocity", "vel", "linear", "twist", "v"]),
        "position": frozenset(["position", "pos", "odom", "pose", "p"]),
    }
)
"""Words of the quantities of a base or an IMU, in the order of the decision."""

_IMU = frozenset(["imu", "gyro", "gyroscope"])
_COMPONENT = re.compile(r"(?P<group>.*?)[._ \-/\[(]?(?P<axis>[xyzwXYZW])[\])]?$")


@dataclass(frozen=True)
class Classified:
    """Columns of a table by their quantity.

    Attributes:
        times: Columns that may be the time.
        parts: Columns by quantity and by the rest of their name, which may be a joint's.
        base: Columns of the root body's vectors, by ``VECTORS``.
        imu: Columns of an IMU's vectors, by ``VECTORS``.
        others: All other columns.
    """

    times: list[str] = field(default_factory=list)
    parts: dict[Quantity, dict[str, str]] = field(default_factory=dict)
    base: dict[str, tuple[str, ...]] = field(default_factory=dict)
    imu: dict[str, tuple[str, ...]] = field(default_factory=dict)
    others: list[str] = field(default_factory=list)


def classified(names: Sequence[str]) -> Classified:
    """Returns the columns of a table by their quantity.

    Args:
        names: Names of the columns.
    """
    found = Classified()
    used = _take_vectors(names, found)
    for name in names:
        words = parts_of(name)
        if name in used:
            continue
        if words and _TIMES.issuperset(set(words) - _UNITS) and set(words) & _TIMES:
            found.times.append(name)
            continue
        for quantity, known in _QUANTITIES.items():
            if known & set(words):
                every = frozenset().union(*_QUANTITIES.values())
                label = "_".join(word for word in words if word not in every | _FILLERS)
                found.parts.setdefault(quantity, {}).setdefault(label, name)
                break
        else:
            found.others.append(name)
    return found


def unit_in(name: str) -> str:
    """Returns the unit of time in the name of a column; "" if there is none."""
    return next((word for word in parts_of(name) if word in ("ms", "us", "ns")), "")


def _take_vectors(names: Sequence[str], found: Classified) -> set[str]:
    groups: dict[str, dict[str, str]] = {}
    for name in names:
        if match := _COMPONENT.fullmatch(name):
            groups.setdefault(match["group"], {}).setdefault(match["axis"].lower(), name)
    used: set[str] = set()
    for group, axes in groups.items():
        words = set(parts_of(group))
        order = "wxyz" if len(axes) == 4 else "xyz"
        for quantity, known in _VECTORS.items():
            if (
                words & known
                and set(axes) == set(order)
                and (len(order) == 4) == (quantity == "orientation")
            ):
                place = found.imu if words & _IMU else found.base
                columns = tuple(axes[axis] for axis in order)
                if quantity not in place:
                    place[quantity] = columns
                    used |= set(columns)
                break
    return used
