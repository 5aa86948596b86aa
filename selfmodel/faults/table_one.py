"""The failures of the paper's Table I, derived for any robot from its anatomy."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from selfmodel.robot.anatomy import Anatomy, Joint, Sensor


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
