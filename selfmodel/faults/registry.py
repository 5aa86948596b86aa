"""The fault kinds of selfmodel, by name."""

from collections.abc import Iterable, Mapping

from selfmodel.faults.broken import BROKEN
from selfmodel.faults.damping import DAMPED_JOINT
from selfmodel.faults.delay import GROWN_DELAY
from selfmodel.faults.encoder import ENCODER_OFFSET
from selfmodel.faults.grip import LOST_GRIP
from selfmodel.faults.ground import FRICTION, SLOPE
from selfmodel.faults.jammed import JAMMED, JAMMED_AT_ANGLE
from selfmodel.faults.joint_friction import JOINT_FRICTION
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.motor import WEAK_MOTOR
from selfmodel.faults.neuron import SILENT_NEURON
from selfmodel.faults.payload import PAYLOAD
from selfmodel.faults.sensor import FAILED_SENSOR, SENSOR_BIAS, SENSOR_GAIN, SENSOR_NOISE
from selfmodel.faults.terrain import ROUGHNESS
from selfmodel.faults.wind import CROSSWIND, WIND

KINDS: Mapping[str, FaultKind] = {
    kind.name: kind
    for kind in (
        *(BROKEN, JAMMED, FAILED_SENSOR, SILENT_NEURON),
        *(JAMMED_AT_ANGLE, WEAK_MOTOR, SENSOR_GAIN, SENSOR_BIAS, SENSOR_NOISE),
        *(FRICTION, SLOPE, ROUGHNESS, WIND, CROSSWIND),
        *(PAYLOAD, DAMPED_JOINT, JOINT_FRICTION, LOST_GRIP, GROWN_DELAY, ENCODER_OFFSET),
    )
}
"""All built-in kinds by name."""

PAPER_KINDS: tuple[FaultKind, ...] = (BROKEN, JAMMED, FAILED_SENSOR)
"""Kinds of the paper's diagnosis, in the order of its genome."""

ALL_KINDS: tuple[FaultKind, ...] = tuple(kind for kind in KINDS.values() if kind.searchable)
"""All built-in kinds that a diagnosis may propose."""


def notation_kinds(kinds: Iterable[FaultKind]) -> tuple[FaultKind, ...]:
    """Returns the kinds that notation may name: the built-in ones, and those of a search.

    Args:
        kinds: Kinds of the search, built-in or third-party; their degenerate kinds are included.
    """
    named = [kind for each in kinds for kind in (each, *each.degenerate_kinds)]
    return tuple(dict.fromkeys((*KINDS.values(), *named)))
