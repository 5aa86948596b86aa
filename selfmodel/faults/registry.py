"""The fault kinds of selfmodel, and the kinds that apply to a robot."""

from collections.abc import Iterable, Mapping, Sequence

from selfmodel.errors import InputError
from selfmodel.faults.broken import BROKEN
from selfmodel.faults.ground import FRICTION, SLOPE
from selfmodel.faults.jammed import JAMMED, JAMMED_AT_ANGLE
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.motor import WEAK_MOTOR
from selfmodel.faults.neuron import SILENT_NEURON
from selfmodel.faults.sensor import FAILED_SENSOR, SENSOR_BIAS, SENSOR_GAIN, SENSOR_NOISE
from selfmodel.faults.terrain import ROUGHNESS
from selfmodel.faults.wind import CROSSWIND, WIND
from selfmodel.robot.anatomy import Anatomy

KINDS: Mapping[str, FaultKind] = {
    kind.name: kind
    for kind in (
        *(BROKEN, JAMMED, FAILED_SENSOR, SILENT_NEURON),
        *(JAMMED_AT_ANGLE, WEAK_MOTOR, SENSOR_GAIN, SENSOR_BIAS, SENSOR_NOISE),
        *(FRICTION, SLOPE, ROUGHNESS, WIND, CROSSWIND),
    )
}
"""Every kind that comes with selfmodel, by its name."""

PAPER_KINDS: tuple[FaultKind, ...] = (BROKEN, JAMMED, FAILED_SENSOR)
"""What the paper's diagnosis considers, in the order of its genome."""

ALL_KINDS: tuple[FaultKind, ...] = tuple(kind for kind in KINDS.values() if kind.searchable)
"""Every kind that a diagnosis may consider."""


def known(kinds: Iterable[FaultKind]) -> tuple[FaultKind, ...]:
    """Returns what notation may name where these are considered: they, and all that come here."""
    named = [kind for one in kinds for kind in (one, *one.others)]
    return tuple(dict.fromkeys((*KINDS.values(), *named)))


def applicable_kinds(kinds: Sequence[FaultKind], anatomy: Anatomy) -> tuple[FaultKind, ...]:
    """Returns those that can strike a robot, and what they are at some degree.

    Who considers joints jammed at an angle considers those jammed at 0, and who considers the
    gain of a sensor considers one of 0: these are kinds of their own.

    Args:
        kinds: What was asked for; these come first, in their order.
        anatomy: The robot's parts.

    Raises:
        InputError: None of them can strike it, or one is not for diagnoses.
    """
    hidden = [kind.name for kind in kinds if not kind.searchable]
    if hidden:
        raise InputError(f"no diagnosis may propose {', '.join(hidden)}: leave it out")
    others = [other for kind in kinds for other in kind.others]
    able = tuple(kind for kind in dict.fromkeys((*kinds, *others)) if kind.candidates(anatomy))
    if not able:
        raise InputError(
            f"the robot has no part that {', '.join(kind.name for kind in kinds)} can strike, so "
            f"there is nothing to diagnose: consider other kinds, or name its limbs and sensors"
        )
    return able
