"""Damage of a body: hinges whose links are absent, hinges that are fixed, and dead sensors."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from selfmodel.errors import InputError, unknown_name
from selfmodel.robot.anatomy import Anatomy, Joint

KINDS = ("break", "jam", "sensor")


@dataclass(frozen=True)
class Damage:
    """Damage, by the names of the parts.

    Attributes:
        lost: Hinges that are absent with the links that they move: all those beyond a break.
        fixed: Angle of each hinge that became a fixed joint, rad.
        dead: Sensors that read 0: failed ones, and touch sensors on absent links.
    """

    lost: frozenset[str] = frozenset()
    fixed: Mapping[str, float] = field(default_factory=dict)
    dead: frozenset[str] = frozenset()


def damage_of(notation: str, anatomy: Anatomy) -> Damage:
    """Returns the damage of a notation: ``break:X``, ``jam:X`` and ``sensor:X``, joined by ``+``.

    A jammed joint is fixed at 0, or at the limit nearest to 0.

    Raises:
        InputError: The notation has another kind of fault, or an unknown part.
    """
    lost: set[str] = set()
    fixed: dict[str, float] = {}
    dead: set[str] = set()
    for term in notation.split("+") if notation != "intact" else ():
        kind, _, part = term.partition(":")
        if kind not in KINDS:
            raise InputError(
                f"expected faults of the kinds {', '.join(KINDS)} without severities, got {term!r}"
            )
        if kind == "sensor":
            dead.add(_known(part, [sensor.name for sensor in anatomy.sensors]))
            continue
        joint = anatomy.joint(_known(part, [joint.name for joint in anatomy.joints]))
        if kind == "jam":
            for hinge, (low, high) in zip(joint.hinges, joint.limits, strict=True):
                fixed[hinge] = min(max(low, 0.0), high)
        else:
            lost |= _hinges_from(joint, anatomy)
            dead |= {
                sensor.name
                for sensor in anatomy.sensors
                if sensor.kind == "touch" and sensor.body in joint.bodies
            }
    kept = {hinge: angle for hinge, angle in fixed.items() if hinge not in lost}
    return Damage(frozenset(lost), kept, frozenset(dead))


def _known(part: str, names: list[str]) -> str:
    if part not in names:
        raise unknown_name("part", part, names)
    return part


def _hinges_from(joint: Joint, anatomy: Anatomy) -> set[str]:
    """Returns the hinges of a joint and of all joints beyond it."""
    beyond = [other for other in anatomy.joints if other.name in joint.descendants]
    return {hinge for one in (joint, *beyond) for hinge in one.hinges}
