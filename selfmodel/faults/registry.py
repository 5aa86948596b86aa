"""The fault kinds of selfmodel, by name."""

from collections.abc import Iterable, Mapping

from selfmodel.faults.kind import FaultKind
from selfmodel.faults.kinds.broken import BROKEN
from selfmodel.faults.kinds.damping import DAMPED_JOINT
from selfmodel.faults.kinds.delay import GROWN_DELAY
from selfmodel.faults.kinds.encoder import ENCODER_OFFSET, ENCODER_SLIP
from selfmodel.faults.kinds.grip import LOST_GRIP
from selfmodel.faults.kinds.ground import FRICTION, SLOPE
from selfmodel.faults.kinds.jammed import JAMMED, JAMMED_AT_ANGLE
from selfmodel.faults.kinds.joint_friction import JOINT_FRICTION
from selfmodel.faults.kinds.motor import WEAK_MOTOR
from selfmodel.faults.kinds.neuron import SILENT_NEURON
from selfmodel.faults.kinds.payload import PAYLOAD
from selfmodel.faults.kinds.sensor import FAILED_SENSOR, SENSOR_BIAS, SENSOR_GAIN, SENSOR_NOISE
from selfmodel.faults.kinds.terrain import ROUGHNESS
from selfmodel.faults.kinds.wind import CROSSWIND, WIND

KINDS: Mapping[str, FaultKind] = {
    kind.name: kind
    for kind in (
        *(BROKEN, JAMMED, FAILED_SENSOR, SILENT_NEURON),
        *(JAMMED_AT_ANGLE, WEAK_MOTOR, SENSOR_GAIN, SENSOR_BIAS, SENSOR_NOISE),
        *(FRICTION, SLOPE, ROUGHNESS, WIND, CROSSWIND),
        *(PAYLOAD, DAMPED_JOINT, JOINT_FRICTION, LOST_GRIP, GROWN_DELAY),
        *(ENCODER_OFFSET, ENCODER_SLIP),
    )
}
"""All built-in kinds by name."""

PAPER_KINDS: tuple[FaultKind, ...] = (BROKEN, JAMMED, FAILED_SENSOR)
"""Kinds of the paper's diagnosis, in the order of its genome."""

BODY_KINDS: tuple[FaultKind, ...] = (BROKEN, JAMMED, JAMMED_AT_ANGLE, FAILED_SENSOR, WEAK_MOTOR)
"""Kinds of faults of the robot itself that are common."""

ENVIRONMENT_KINDS: tuple[FaultKind, ...] = (FRICTION, SLOPE, WIND, PAYLOAD)
"""Kinds of changes of the robot's environment that are common."""

ALL_KINDS: tuple[FaultKind, ...] = tuple(kind for kind in KINDS.values() if kind.searchable)
"""All built-in kinds that a diagnosis may propose."""

KIND_SETS: Mapping[str, tuple[FaultKind, ...]] = {
    "paper": PAPER_KINDS,
    "body": BODY_KINDS,
    "environment": ENVIRONMENT_KINDS,
    "default": (*BODY_KINDS, *ENVIRONMENT_KINDS),
    "all": ALL_KINDS,
}
"""Sets of kinds, by the names that ``--kinds`` accepts in place of their kinds."""

DEFAULT_KINDS: tuple[FaultKind, ...] = KIND_SETS["default"]
"""Kinds that a diagnosis, a recovery or an ablation searches if none are given."""


def kind_names(names: str) -> str:
    """Returns names of kinds with the names of sets replaced by those of their kinds.

    Args:
        names: Names of kinds and sets, separated by commas, as for ``--kinds``.

    Returns:
        Names of kinds, each once, separated by commas; unknown names are unchanged.
    """
    given = (name.strip() for name in names.split(","))
    return ",".join(
        dict.fromkeys(
            single
            for name in given
            for single in ([kind.name for kind in KIND_SETS[name]] if name in KIND_SETS else [name])
        )
    )


def notation_kinds(kinds: Iterable[FaultKind]) -> tuple[FaultKind, ...]:
    """Returns the kinds that notation may name: the built-in ones, and those of a search.

    Args:
        kinds: Kinds of the search, built-in or third-party; their degenerate kinds are included.
    """
    named = [kind for each in kinds for kind in (each, *each.degenerate_kinds)]
    return tuple(dict.fromkeys((*KINDS.values(), *named)))
