"""The diagnostics of ROS 2: what a finding says about each part of a robot."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum

from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.kind import Fault
from selfmodel.robot.anatomy import Anatomy
from selfmodel.robot.robot import Robot
from selfmodel.watching.finding import Finding, Rated, Status


class Level(IntEnum):
    """Level of a ``diagnostic_msgs/msg/DiagnosticStatus``."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


_LEVELS: Mapping[Status, tuple[Level, Level]] = {
    "watching": (Level.OK, Level.OK),
    "not judged": (Level.WARN, Level.OK),
    "stale": (Level.STALE, Level.STALE),
    "changed": (Level.WARN, Level.WARN),
    "explained": (Level.ERROR, Level.ERROR),
    "ambiguous": (Level.ERROR, Level.WARN),
    "unexplained": (Level.ERROR, Level.WARN),
}
"""Levels of the robot, and of the parts that a finding is about. Where several causes are left, or
none, no part is known to be at fault."""


@dataclass(frozen=True)
class PartStatus:
    """State of a part of a robot, with the fields of a ``diagnostic_msgs/msg/DiagnosticStatus``.

    Attributes:
        level: Level.
        name: ``selfmodel:`` and the name of the part, a space between them.
        message: What is known of it, in plain words.
        hardware_id: Name of the robot.
        values: ``onset``, ``earliest`` and ``latest`` of the change, s; ``hypothesis`` and ``loss``
            of the best cause that is left, of this part or of any; and ``fault_code``, its kind
            and its part in capitals, once it is the explanation.
    """

    level: Level
    name: str
    message: str
    hardware_id: str
    values: Mapping[str, str]


def part_statuses(robot: Robot, finding: Finding) -> tuple[PartStatus, ...]:
    """Returns the states of the robot as a whole, of each hinge and of each sensor.

    Example:
        >>> import selfmodel
        >>> from selfmodel.watching import Finding, part_statuses
        >>> changed = Finding(1.44, "changed", shown_by=("front_left_knee",))
        >>> statuses = part_statuses(selfmodel.load_robot("quadruped"), changed)
        >>> [one.name for one in statuses if one.level]
        ['selfmodel: quadruped', 'selfmodel: front_left_knee']
    """
    names, (of_robot, of_part) = robot.anatomy.names, _LEVELS[finding.status]
    is_known, causes = finding.status == "explained", _causes(robot.anatomy, finding)

    def of(name: str) -> PartStatus:
        level, message, cause = Level.OK, "OK", causes.get(name)
        if finding.status == "stale":
            level, message = of_part, finding.reason
        elif cause is not None:
            level, message = of_part, cause.hypothesis.words
            message = message if is_known else f"perhaps {message}"
        elif name in finding.shown_by and not is_known:
            level, message = of_part, "shows a change"
        values = _values(finding, cause) if level else {}
        return PartStatus(level, f"selfmodel: {name}", message, robot.name, values)

    values = _values(finding, next(iter(finding.remaining), None))
    whole = PartStatus(of_robot, f"selfmodel: {robot.name}", finding.words, robot.name, values)
    # Of an imported model, a sensor may have the name of the hinge that it measures.
    return whole, *(of(name) for name in dict.fromkeys((*names.hinges, *names.sensors)))


def _causes(anatomy: Anatomy, finding: Finding) -> dict[str, Rated]:
    """Returns the best cause about each hinge and sensor that one may explain."""
    causes: dict[str, Rated] = {}
    for rated in () if finding.status == "unexplained" else finding.remaining:
        for fault in rated.hypothesis.faults:
            for name in _parts(fault, anatomy):
                causes.setdefault(name, rated)
    return causes


def _values(finding: Finding, cause: Rated | None) -> dict[str, str]:
    times = {key: getattr(finding, key) for key in ("onset", "earliest", "latest")}
    values = {key: str(time) for key, time in times.items() if time is not None}
    if cause is not None:
        values |= {"hypothesis": str(cause.hypothesis), "loss": f"{cause.loss:.6g}"}
        if finding.status == "explained":
            values["fault_code"] = _code(cause.hypothesis)
    return values


def _parts(fault: Fault, anatomy: Anatomy) -> set[str]:
    """Returns the names of the hinges and of the sensor that a fault is about."""
    joints = (hinge for one in anatomy.joints if one.name == fault.part for hinge in one.hinges)
    return {fault.part, *joints, *fault.kind.hinges(anatomy, fault.part)}


def _code(hypothesis: Hypothesis) -> str:
    """Returns the kind and the part of each fault, whatever its severity, in capitals."""
    faults = sorted(f"{kind.name} {part}" for kind, part in hypothesis.without_severities)
    return re.sub(r"\W+", "_", " ".join(faults)).strip("_").upper()
