"""A failed sensor: the controller receives 0 from it."""

from typing import TYPE_CHECKING

from selfmodel.anatomy import Anatomy
from selfmodel.faults.kind import Fault, Kind

if TYPE_CHECKING:
    from selfmodel.embodiment import Embodiment


def _parts(anatomy: Anatomy) -> tuple[str, ...]:
    return tuple(sensor.name for sensor in anatomy.sensors)


def _strike(embodiment: "Embodiment", anatomy: Anatomy, fault: Fault) -> None:
    embodiment.fix_reading(_parts(anatomy).index(fault.part), 0.0)


FAILED_SENSOR = Kind(name="sensor", parts=_parts, strike=_strike)
