"""Position servos for the hinges of a URDF, from the limits of effort and velocity."""

import math
from collections.abc import Sequence
from fnmatch import fnmatchcase
from xml.etree import ElementTree as ET  # of checked texts

from selfmodel.errors import InputError, unknown_name
from selfmodel.robot.urdf.reading import number
from selfmodel.robot.urdf.settings import URDF_SETTINGS, UrdfSettings, value_of
from selfmodel.robot.urdf.tree import quoted

FULL_EFFORT_ERROR = 0.5
"""Position error at which a servo without the setting ``kp`` exerts its full effort, rad; half of
the joint's range, if that is less."""

DAMPING_TIMES = (0.02, 0.1)
"""Least and greatest kd / kp of a servo without the setting ``kd``, s. In between, the damping
equals the effort at the velocity limit."""

UNLIMITED_RANGE = (-math.pi, math.pi)
"""Command range of a continuous joint, rad."""


def servo(joint: ET.Element, settings: UrdfSettings) -> tuple[ET.Element, str]:
    """Returns the position servo of a joint as MJCF, and a note.

    Args:
        joint: The ``<joint>`` of the URDF, a hinge.
        settings: Settings with kp, kd and effort.

    Raises:
        InputError: The joint has no effort limit, and the settings contain none.
    """
    name = joint.get("name", "")
    limit = joint.find("limit")
    limit = ET.Element("limit") if limit is None else limit
    effort = value_of(settings.effort, name)
    if effort is None:
        effort = number(limit, "effort", 0.0)
    if effort <= 0:
        raise InputError(
            f"the joint {quoted(name)} has no effort limit above 0: add it to its <limit>, or "
            f"set the torque of such joints, in N m, with effort = ..."
        )
    low, high = UNLIMITED_RANGE
    if joint.get("type") == "revolute":
        low, high = number(limit, "lower", 0.0), number(limit, "upper", 0.0)
    first, last = _commands(name, (low, high), settings)
    kp = value_of(settings.kp, name)
    if kp is None:
        kp = effort / min(FULL_EFFORT_ERROR, (high - low) / 2)
    kd = value_of(settings.kd, name)
    if kd is None:
        velocity = number(limit, "velocity", 0.0)
        least, most = (kp * time for time in DAMPING_TIMES)
        kd = most if velocity <= 0 else min(max(effort / velocity, least), most)
    attributes = {
        "name": name,
        "joint": name,
        "kp": repr(kp),
        "kv": repr(kd),
        "ctrlrange": f"{first!r} {last!r}",
        "ctrllimited": "true",
        "forcerange": f"{-effort!r} {effort!r}",
        "forcelimited": "true",
    }
    return ET.Element("position", attributes), f"kp {kp:.3g}, kd {kd:.3g}, {effort:.3g} N m"


def _commands(joint: str, ends: tuple[float, float], settings: UrdfSettings) -> tuple[float, float]:
    """Returns the lowest and highest command of a joint, given the ends of its range, rad."""
    swing = value_of(settings.swing, joint)
    if not swing:
        return ends
    angle = value_of(settings.pose, joint)
    centre = min(max(0.0, ends[0]), ends[1]) if angle is None else angle
    return max(ends[0], centre - swing), min(ends[1], centre + swing)


def check_patterns(settings: UrdfSettings, joints: Sequence[str]) -> None:
    """Checks that each name or pattern in the settings fits a joint.

    Raises:
        InputError: One fits none.
    """
    for name in URDF_SETTINGS:
        for pattern in getattr(settings, name):
            if not any(fnmatchcase(joint, pattern) for joint in joints):
                raise unknown_name("joint", pattern, list(joints))
