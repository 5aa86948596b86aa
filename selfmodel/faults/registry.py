"""The fault kinds of selfmodel by name, their sets, and the failures of the paper's Table I.

A further kind is a class of what it faults, in ``joints.py``, ``sensors.py`` or ``world.py``, its
row in ``KINDS`` and, to be searched by default, in one of the sets below it, and its name on the
help page, ``cli/options.toml``.
"""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import partial

from selfmodel.errors import InputError, unknown_name
from selfmodel.faults import joints, sensors, world
from selfmodel.faults.kind import FaultKind
from selfmodel.robot.anatomy import Anatomy, Joint

KINDS: Mapping[str, FaultKind] = {
    kind.name: kind
    for kind in (
        *(joints.BROKEN, joints.JAMMED, sensors.FAILED_SENSOR, sensors.SILENT_NEURON),
        *(joints.JAMMED_AT_ANGLE, joints.WEAK_MOTOR),
        *(sensors.SENSOR_GAIN, sensors.SENSOR_BIAS, sensors.SENSOR_NOISE),
        *(world.FRICTION, world.SLOPE, world.ROUGHNESS, world.WIND, world.CROSSWIND),
        *(world.PAYLOAD, joints.DAMPED_JOINT, joints.JOINT_FRICTION, joints.LOST_GRIP),
        *(world.GROWN_DELAY, joints.ENCODER_OFFSET, joints.ENCODER_SLIP, joints.LOADED_LINK),
        *(joints.SERVO_GAIN, joints.MOTOR_OFF, joints.LOCKED_LEG),
    )
}
"""All built-in kinds by name."""

PAPER_KINDS: tuple[FaultKind, ...] = (joints.BROKEN, joints.JAMMED, sensors.FAILED_SENSOR)
"""Kinds of the paper's diagnosis, in the order of its genome."""

_BODY_KINDS = tuple(KINDS[name] for name in ("break", "jam", "jam-angle", "leg", "sensor", "motor"))
_ENVIRONMENT_KINDS = tuple(KINDS[name] for name in ("friction", "slope", "wind", "payload"))

ALL_KINDS: tuple[FaultKind, ...] = tuple(kind for kind in KINDS.values() if kind.searchable)
"""All built-in kinds that a diagnosis may propose."""

KIND_SETS: Mapping[str, tuple[FaultKind, ...]] = {
    "paper": PAPER_KINDS,
    "body": _BODY_KINDS,
    "environment": _ENVIRONMENT_KINDS,
    "default": (*_BODY_KINDS, joints.SERVO_GAIN, joints.MOTOR_OFF, *_ENVIRONMENT_KINDS),
    "all": ALL_KINDS,
}
"""Sets of kinds, by the names that ``--kinds`` accepts in place of their kinds. ``body`` and
``environment`` are the common faults of the robot itself and changes of its environment."""

DEFAULT_KINDS: tuple[FaultKind, ...] = KIND_SETS["default"]
"""Kinds that a diagnosis, a recovery or an ablation searches if none are given."""


def suitable(kinds: Sequence[FaultKind], anatomy: Anatomy) -> tuple[FaultKind, ...]:
    """Returns kinds to search; if all of the environment are given, those that suit a robot."""
    whole = set(kinds).issuperset(_ENVIRONMENT_KINDS)
    return tuple(kind for kind in kinds if kind.suits(anatomy) or not whole)


def kind_names(names: str) -> str:
    """Returns names of kinds and sets, as for ``--kinds``, as names of kinds, each once.

    They are separated by commas; unknown names are unchanged.
    """
    single: list[str] = []
    for name in (each.strip() for each in names.split(",")):
        single += [kind.name for kind in KIND_SETS[name]] if name in KIND_SETS else [name]
    return ",".join(dict.fromkeys(single))


def notation_kinds(kinds: Iterable[FaultKind]) -> tuple[FaultKind, ...]:
    """Returns the built-in kinds, and those of a search with their degenerate kinds."""
    named = [kind for each in kinds for kind in (each, *each.degenerate_kinds)]
    return tuple(dict.fromkeys((*KINDS.values(), *named)))


TABLE_ONE: Mapping[int, str] = {
    1: "a lower leg breaks off",
    2: "a whole leg breaks off",
    3: "a touch sensor fails",
    4: "2, and the touch sensor of another leg fails",
    5: "an angle sensor fails",
    6: "an upper-leg joint jams",
    7: "2, and the upper-leg joint of another leg jams",
    8: "7, and the angle sensor of a further leg fails",
    9: "nothing fails",
    10: "a hidden neuron fails",
}
"""Failures by their number in the paper's Table I."""

_TOUCH, _ANGLE = "a touch sensor at", "an angle sensor at"
CASE_NEEDS: Mapping[int, str] = {
    1: "a limb of two joints",
    2: "a limb",
    3: f"{_TOUCH} its first limb",
    4: f"{_TOUCH} another than its first limb",
    5: f"{_ANGLE} its first limb",
    6: "a limb",
    7: "two limbs",
    8: f"{_ANGLE} a third limb",
}
"""What a robot without a case of Table I lacks."""


def check_cases(cases: Iterable[int], where: str, known: Collection[int]) -> None:
    """Raises ``InputError`` for a case that a robot, or Table I, does not have."""
    for case in cases:
        if case not in known and case in CASE_NEEDS:
            raise InputError(
                f"case {case} of Table I, {TABLE_ONE[case]}, does not apply to {where}: it needs "
                f"{CASE_NEEDS[case]}; the cases that apply are {', '.join(map(str, known))}"
            )
        if case not in known:
            raise unknown_name(f"case of {where}", str(case), map(str, known))


def cases_of(anatomy: Anatomy, is_leg: Callable[[Sequence[Joint]], bool]) -> Mapping[int, str]:
    """Returns a robot's failures by their number in Table I, in notation.

    A limb is a chain of joints without branches. If some limbs are legs, only these count; all
    limbs of a robot without legs do, such as those of a swimmer. Limbs with touch sensors come
    first, then the order is the model's. Cases that a robot cannot have are omitted: 3 and 4
    without touch sensors; 4, 7 and 8 with one limb; 8 with two limbs.

    ``is_leg``, such as ``reaches_ground``, is given the joints of a limb, the one nearest to the
    root body first.

    Source: the paper, Table I; for the paper's two robots the cases equal the paper's.
    """
    every = limbs(anatomy)
    every = [limb for limb in every if is_leg(limb)] or every
    if not every:
        return {9: "intact", 10: "neuron:0"}
    first, *others = every
    failed = partial(_failed_sensor, anatomy)
    lost = f"break:{first[0].name}"
    # The paper jams the leg behind the detached leg, not the opposite leg.
    behind = next(iter(others[1:] or others), None)
    jammed = behind and _compound(lost, f"jam:{behind[0].name}")
    rest = [failed("angle", limb) for limb in others if limb is not behind]
    by_number = {
        1: f"break:{first[-1].name}" if len(first) > 1 else None,
        2: lost,
        3: failed("touch", first),
        4: _compound(lost, next(filter(None, (failed("touch", limb) for limb in others)), None)),
        5: failed("angle", first),
        6: f"jam:{first[0].name}",
        7: jammed,
        8: jammed and _compound(jammed, next(filter(None, reversed(rest)), None)),
        9: "intact",
        10: "neuron:0",
    }
    return {number: notation for number, notation in by_number.items() if notation}


def limbs(anatomy: Anatomy) -> list[tuple[Joint, ...]]:
    """Returns the joints of each limb from the root body on; limbs with touch sensors first."""
    every = anatomy.limbs.values()
    return sorted(every, key=lambda limb: not _failed_sensor(anatomy, "touch", limb))  # stable


def _failed_sensor(anatomy: Anatomy, kind: str, limb: Sequence[Joint]) -> str | None:
    """Returns the failure of a limb's first angle sensor, or outermost touch sensor."""
    sensors = [one for one in anatomy.sensors if one.kind == kind and one.body in limb[0].bodies]
    if kind == "touch":
        sensors.sort(key=lambda one: -sum(one.body in joint.bodies for joint in limb))  # stable
    return f"sensor:{sensors[0].name}" if sensors else None


def _compound(first: str, second: str | None) -> str | None:
    return second and f"{first}+{second}"
