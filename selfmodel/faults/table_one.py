"""Failures like those of the paper's Table I, made for any body by one rule."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from selfmodel.robot.anatomy import Anatomy, Joint, Sensor


@dataclass(frozen=True)
class _Limb:
    """Joints that hang on one another without branching, and what is lost with all of them.

    Attributes:
        joints: From the one nearest the root outwards.
        touch: The touch sensors on it, the outermost first.
        angle: The angle sensors of its joints.
    """

    joints: tuple[Joint, ...]
    touch: tuple[str, ...]
    angle: tuple[str, ...]


def cases_of(anatomy: Anatomy) -> Mapping[int, str]:
    """Returns a robot's failures by the number that they have in Table I, in notation.

    A limb is a row of joints that does not branch; those that feel the ground come first, then in
    the model's order. What a body cannot have is left out: without touch sensors 3 and 4, with one
    limb 4, 7 and 8, with two limbs 8.

    Source: the paper, Table I; for its two robots these are its failures.
    """
    limbs = _limbs(anatomy)
    found: dict[int, str | None] = dict.fromkeys(range(1, 9))
    if limbs:
        first, others = limbs[0], limbs[1:]
        lost = f"break:{first.joints[0].name}"
        found[1] = f"break:{first.joints[-1].name}" if len(first.joints) > 1 else None
        found[2] = lost
        found[3] = _dead(first.touch)
        found[4] = _also(lost, _dead(name for limb in others for name in limb.touch))
        found[5] = _dead(first.angle)
        found[6] = f"jam:{first.joints[0].name}"
        # The paper jams the leg behind the lost one, not the one opposite.
        held = next(iter(others[1:] or others), None)
        found[7] = _also(lost, f"jam:{held.joints[0].name}" if held else None)
        rest = [limb for limb in others if limb is not held and limb.angle]
        found[8] = found[7] and _also(found[7], _dead(rest[-1].angle if rest else ()))
    cases = {number: notation for number, notation in found.items() if notation}
    return cases | {9: "intact", 10: "neuron:0"}


def _limbs(anatomy: Anatomy) -> Sequence[_Limb]:
    joints = {joint.name: joint for joint in anatomy.joints}
    beyond = {name: joint.descendants & joints.keys() for name, joint in joints.items()}
    ends = [name for name in joints if not beyond[name]]
    limbs = []
    for end in ends:
        # Of a joint on which two ends hang neither is the limb's.
        row = [n for n in joints if n == end or (end in beyond[n] and _is_row(beyond, n))]
        row.sort(key=lambda name: -len(beyond[name]))
        limbs.append(_limb([joints[name] for name in row], anatomy.sensors))
    return sorted(limbs, key=lambda limb: not limb.touch)  # stable


def _is_row(beyond: Mapping[str, frozenset[str]], name: str) -> bool:
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


def _dead(sensors: Iterable[str]) -> str | None:
    first = next(iter(sensors), None)
    return first and f"sensor:{first}"


def _also(one: str, other: str | None) -> str | None:
    return other and f"{one}+{other}"
