"""A jammed joint: it is held rigidly at an angle."""

from typing import TYPE_CHECKING

from selfmodel.anatomy import Anatomy
from selfmodel.faults.kind import Fault, Kind

if TYPE_CHECKING:
    from selfmodel.embodiment import Embodiment


def _parts(anatomy: Anatomy) -> tuple[str, ...]:
    return tuple(joint.name for joint in anatomy.joints)


def _strike(embodiment: "Embodiment", anatomy: Anatomy, fault: Fault) -> None:
    joint = anatomy.joint(fault.part)
    for hinge in joint.hinges:
        embodiment.hold_hinge(hinge, fault.degree)
    for motor in joint.motors:
        embodiment.release_motor(anatomy.motors.index(motor))
    for column, sensor in enumerate(anatomy.sensors):
        if sensor.hinge in joint.hinges:
            embodiment.fix_reading(column, fault.degree / sensor.half_range)


def _absorbs(fault: Fault, other: Fault, anatomy: Anatomy) -> bool:
    """A sensor of a joint held at 0 reads 0, and so does a failed one."""
    if other.kind != "sensor" or fault.degree != 0:
        return False
    return anatomy.sensor(other.part).hinge in anatomy.joint(fault.part).hinges


def _degrees(anatomy: Anatomy, part: str) -> tuple[float, float]:
    limits = anatomy.joint(part).limits
    return max(low for low, _ in limits), min(high for _, high in limits)


JAMMED = Kind(
    name="jam", parts=_parts, strike=_strike, absorbs=_absorbs, degrees=_degrees, unit="rad"
)
