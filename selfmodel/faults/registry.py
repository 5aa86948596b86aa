"""The fault kinds of selfmodel by name, their sets, and the failures of the paper's Table I."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from selfmodel.faults.joints import (
    BROKEN,
    DAMPED_JOINT,
    ENCODER_OFFSET,
    ENCODER_SLIP,
    JAMMED,
    JAMMED_AT_ANGLE,
    JOINT_FRICTION,
    LOST_GRIP,
    WEAK_MOTOR,
)
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.sensors import (
    FAILED_SENSOR,
    SENSOR_BIAS,
    SENSOR_GAIN,
    SENSOR_NOISE,
    SILENT_NEURON,
)
from selfmodel.faults.terrain import ROUGHNESS
from selfmodel.faults.world import CROSSWIND, FRICTION, GROWN_DELAY, PAYLOAD, SLOPE, WIND
from selfmodel.robot.anatomy import Anatomy, Joint, Sensor

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


@dataclass(frozen=True)
class _Limb:
    """A kinematic chain without branches, and its sensors.

    Attributes:
        joints: Joints, the one nearest to the root body first.
        touch: Names of the touch sensors, the outermost first.
        angle: Names of the angle sensors of the joints.
    """

    joints: tuple[Joint, ...]
    touch: tuple[str, ...]
    angle: tuple[str, ...]


def cases_of(anatomy: Anatomy, is_leg: Callable[[Sequence[Joint]], bool]) -> Mapping[int, str]:
    """Returns a robot's failures by their number in Table I, in notation.

    A limb is a chain of joints without branches. If some limbs are legs, only these count; all
    limbs of a robot without legs do, such as those of a swimmer. Limbs with touch sensors come
    first, then the order is the model's. Cases that a robot cannot have are omitted: 3 and 4
    without touch sensors; 4, 7 and 8 with one limb; 8 with two limbs.

    Source: the paper, Table I; for the paper's two robots the cases equal the paper's.

    Args:
        anatomy: The robot's parts.
        is_leg: Function from the joints of a limb, the one nearest to the root body first, to
            whether the limb is a leg, such as ``reaches_ground``.
    """
    limbs = _limbs(anatomy)
    limbs = [limb for limb in limbs if is_leg(limb.joints)] or limbs
    by_number: dict[int, str | None] = dict.fromkeys(range(1, 9))
    if limbs:
        first, others = limbs[0], limbs[1:]
        detached_limb = f"break:{first.joints[0].name}"
        by_number[1] = f"break:{first.joints[-1].name}" if len(first.joints) > 1 else None
        by_number[2] = detached_limb
        by_number[3] = _failed(first.touch)
        by_number[4] = _compound(
            detached_limb, _failed(name for limb in others for name in limb.touch)
        )
        by_number[5] = _failed(first.angle)
        by_number[6] = f"jam:{first.joints[0].name}"
        # The paper jams the leg behind the detached leg, not the opposite leg.
        jammed = next(iter(others[1:] or others), None)
        by_number[7] = _compound(detached_limb, f"jam:{jammed.joints[0].name}" if jammed else None)
        rest = [limb for limb in others if limb is not jammed and limb.angle]
        by_number[8] = by_number[7] and _compound(
            by_number[7], _failed(rest[-1].angle if rest else ())
        )
    cases = {number: notation for number, notation in by_number.items() if notation}
    return cases | {9: "intact", 10: "neuron:0"}


def _limbs(anatomy: Anatomy) -> Sequence[_Limb]:
    joints = {joint.name: joint for joint in anatomy.joints}
    beyond = {name: joint.descendants & joints.keys() for name, joint in joints.items()}
    ends = [name for name in joints if not beyond[name]]
    limbs = []
    for end in ends:
        # A joint with two chain ends beyond it belongs to no limb.
        chain = [n for n in joints if n == end or (end in beyond[n] and _is_chain(beyond, n))]
        chain.sort(key=lambda name: -len(beyond[name]))
        limbs.append(_limb([joints[name] for name in chain], anatomy.sensors))
    return sorted(limbs, key=lambda limb: not limb.touch)  # stable


def _is_chain(beyond: Mapping[str, frozenset[str]], name: str) -> bool:
    return sum(not beyond[other] for other in beyond[name]) == 1


def _limb(joints: Sequence[Joint], sensors: Iterable[Sensor]) -> _Limb:
    own = [sensor for sensor in sensors if sensor.body in joints[0].bodies]
    outwards = {s.name: sum(s.body in joint.bodies for joint in joints) for s in own}
    touch = [sensor.name for sensor in own if sensor.kind == "touch"]
    return _Limb(
        joints=tuple(joints),
        touch=tuple(sorted(touch, key=lambda name: -outwards[name])),  # stable
        angle=tuple(sensor.name for sensor in own if sensor.kind == "angle"),
    )


def _failed(sensors: Iterable[str]) -> str | None:
    first = next(iter(sensors), None)
    return first and f"sensor:{first}"


def _compound(first: str, second: str | None) -> str | None:
    return second and f"{first}+{second}"
