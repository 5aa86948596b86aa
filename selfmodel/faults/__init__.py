"""The kinds of fault and of environment: what each means, where it strikes and what it does."""

from collections.abc import Iterable, Mapping

from selfmodel.faults.broken import BROKEN
from selfmodel.faults.ground import FRICTION, SLOPE
from selfmodel.faults.jammed import JAMMED, JAMMED_AT_ANGLE
from selfmodel.faults.kind import WORLD, Fault, Kind, between, grid
from selfmodel.faults.motor import WEAK_MOTOR
from selfmodel.faults.neuron import SILENT_NEURON
from selfmodel.faults.sensor import FAILED_SENSOR, SENSOR_BIAS, SENSOR_GAIN, SENSOR_NOISE
from selfmodel.faults.terrain import ROUGHNESS
from selfmodel.faults.wind import CROSSWIND, WIND

KINDS: Mapping[str, Kind] = {
    kind.name: kind
    for kind in (
        *(BROKEN, JAMMED, FAILED_SENSOR, SILENT_NEURON),
        *(JAMMED_AT_ANGLE, WEAK_MOTOR, SENSOR_GAIN, SENSOR_BIAS, SENSOR_NOISE),
        *(FRICTION, SLOPE, ROUGHNESS, WIND, CROSSWIND),
    )
}
"""Every kind that comes with selfmodel, by its name."""

PAPER_KINDS: tuple[Kind, ...] = (BROKEN, JAMMED, FAILED_SENSOR)
"""What the paper's diagnosis considers, in the order of its genome."""

ALL_KINDS: tuple[Kind, ...] = tuple(kind for kind in KINDS.values() if kind.hypothesised)
"""Every kind that a diagnosis may consider."""


def known(kinds: Iterable[Kind]) -> tuple[Kind, ...]:
    """Returns what notation may name where these are considered: they, and all that come here."""
    named = [kind for one in kinds for kind in (one, *one.others)]
    return tuple(dict.fromkeys((*KINDS.values(), *named)))


__all__ = [
    "ALL_KINDS",
    "KINDS",
    "PAPER_KINDS",
    "WORLD",
    "Fault",
    "Kind",
    "between",
    "grid",
    "known",
]
