"""Names in recordings: similarity to names of a model, and what the columns of a table are."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from difflib import SequenceMatcher

from selfmodel.logs.recordings.mapping import VECTORS

CERTAIN_SIMILARITY = 0.75
"""Minimum similarity of a certain match, of at most 1, if no other name is ``CERTAIN_LEAD``."""

MIN_SIMILARITY = 0.3
"""Minimum similarity of a match."""

CERTAIN_LEAD = 0.1
"""Minimum lead over the second most similar name of a certain match."""

LONGEST = 200
"""Length of the longest name that is compared, characters."""

_WORDS: Mapping[str, tuple[str, ...]] = {
    word: tuple(meaning.split())
    for words, meaning in {
        "fl lf": "front left",
        "fr rf": "front right",
        "ml lm": "middle left",
        "mr rm": "middle right",
        "bl lb hl lh rl": "back left",
        "br rb hr rh rr": "back right",
        "rear hind": "back",
        "fore": "front",
        "mid": "middle",
        "l": "left",
        "r": "right",
        "hfe thigh femur upper": "shoulder",
        "kfe calf shank tibia lower": "knee",
        "haa": "hip",
        "foot ft contact force wrench sole": "touch",
        "joint motor servo actuator link position": "",  # which identify no joint
    }.items()
    for word in words.split()
}

_SIDES = (frozenset({"front", "middle", "back"}), frozenset({"left", "right"}))
"""Sets of exclusive words: names with two words of one set never match."""

UNITREE_LEGS = ("FR", "FL", "RR", "RL")
UNITREE = tuple(f"{leg}_{part}" for leg in UNITREE_LEGS for part in ("hip", "thigh", "calf"))
"""Joints of Unitree's quadrupeds in the order of their messages, whose other motors are unused."""

_ELEMENT = re.compile(r"(?P<list>.+?)\[(?P<place>\d+)\](?P<field>(?:\.\w+)*)")


def matched(wanted: Sequence[str], offered: Sequence[str]) -> dict[str, tuple[str, bool]]:
    """Returns the most similar offered name for each wanted name, each used once.

    Order, case and the usual abbreviations do not matter: ``FL_calf_joint`` is similar to
    ``front_left_knee``. With an offered name is whether the match is certain. Wanted names without
    a match are left out.
    """
    scores = {(ours, theirs): likeness(ours, theirs) for ours in wanted for theirs in offered}
    found: dict[str, tuple[str, bool]] = {}
    used: set[str] = set()
    for (ours, theirs), score in sorted(scores.items(), key=lambda item: -item[1]):
        if score < MIN_SIMILARITY or ours in found or theirs in used:
            continue
        competing = [scores[ours, other] for other in offered if other != theirs]
        competing += [scores[other, theirs] for other in wanted if other != ours]
        lead = score - max(competing, default=0.0)
        found[ours] = theirs, score >= CERTAIN_SIMILARITY and lead >= CERTAIN_LEAD
        used.add(theirs)
    return found


def likeness(ours: str, theirs: str) -> float:
    """Returns the similarity of two names, 0 to 1, which is 1 for the same words or initials.

    It is 0 for names longer than ``LONGEST``: its time is the square of their length.
    """
    if max(len(ours), len(theirs)) > LONGEST:
        return 0.0
    if "".join(word[0] for word in words_of(ours)) == theirs.lower():
        return 1.0
    first, second = (
        {meaning for word in words_of(name) for meaning in _WORDS.get(word, (word,))}
        for name in (ours, theirs)
    )
    if any((first & sides) and (second & sides) and not first & second & sides for sides in _SIDES):
        return 0.0
    common = len(first & second)
    words = 2 * common / (len(first) + len(second)) if first or second else 0.0
    letters = SequenceMatcher(None, "".join(sorted(first)), "".join(sorted(second))).ratio()
    return 0.9 * words + 0.1 * letters


def words_of(name: str) -> list[str]:
    """Returns the words of a name: ``FLKnee_2`` has ``fl``, ``knee`` and ``2``."""
    return [part.lower() for part in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", name)]


# ---------------------------------------------------------------- columns of a table


def _sets(words: Mapping[str, str]) -> Mapping[str, frozenset[str]]:
    return {name: frozenset(text.split()) for name, text in words.items()}


_QUANTITIES = _sets(
    {
        "command": "command commands cmd target targets desired des setpoint goal "
        "reference ref action actions ctrl control",
        "velocity": "velocity velocities vel qd dq qvel qdot",
        "effort": "effort efforts torque torques tau",
        "sensor": "sensor sensors reading readings",
        "position": "position positions pos q qpos angle angles theta",
    }
)
"""Words of each quantity, in the order of the decision: ``position_target`` is a command."""

_VECTORS = _sets(
    {
        "orientation": "orientation ori quat quaternion rot rotation attitude q",
        "angular_velocity": "angular ang gyro omega gyroscope w",
        "linear_acceleration": "acceleration acc accel accelerometer",
        "linear_velocity": "velocity vel linear twist v",
        "position": "position pos odom pose p",
    }
)
"""Words of the quantities of a base or an IMU, in the order of the decision."""

_NUMBERED = ("orientation", "angular_velocity", "linear_acceleration")
"""Quantities whose components may be numbers: ``pos_0`` to ``pos_2`` are of three joints."""

_OTHERS = _sets(
    {
        "time": "time t timestamp stamp ts elapsed epoch sec secs seconds",
        "unit": "s ms us ns sec",
        "filler": "rad deg degrees nm joint state states m",
        "imu": "imu gyro gyroscope accelerometer",
    }
)
_COMPONENT = re.compile(r"(?P<group>.*?)[._ \-/\[(]?(?P<axis>[xyzwXYZW]|(?<!\d)\d)[\])]?$")
_COMMANDS = re.compile(r"command|cmd|target|desired|setpoint|goal|reference|(q|pos|\b)(des|ref)\b")


@dataclass(frozen=True)
class Classified:
    """Columns of a table by their quantity.

    ``parts`` has ``command``, ``velocity``, ``effort``, ``sensor`` and ``position``, each by the
    rest of the name, which may be a joint's; ``vectors`` those of ``base`` and of ``imu``.
    """

    times: list[str] = field(default_factory=list)
    parts: dict[str, dict[str, str]] = field(default_factory=dict)
    vectors: dict[str, dict[str, tuple[str, ...]]] = field(default_factory=dict)
    others: list[str] = field(default_factory=list)


def classified(names: Sequence[str]) -> Classified:
    """Returns the columns of a table by their quantity."""
    found = Classified(vectors=_vectors(names))
    used = {n for vectors in found.vectors.values() for some in vectors.values() for n in some}
    for name in (name for name in names if name not in used):
        words = words_of(name)
        if set(words) & _OTHERS["time"] and set(words) <= _OTHERS["time"] | _OTHERS["unit"]:
            found.times.append(name)
            continue
        commanded = is_command(name) or not _QUANTITIES["command"].isdisjoint(words)
        if quantity := "command" if commanded else quantity_of(name):
            fillers = _OTHERS["filler"].union(*_QUANTITIES.values())
            label = "_".join(word for word in words if word not in fillers)
            found.parts.setdefault(quantity, {}).setdefault(label, name)
        else:
            found.others.append(name)
    return found


def elements(names: Sequence[str]) -> dict[tuple[str, str], list[str]]:
    """Returns the elements of lists in messages in order, by list and field of the element."""
    found: dict[tuple[str, str], list[str]] = {}
    for name in names:
        if match := _ELEMENT.fullmatch(name):
            found.setdefault((match["list"], match["field"]), []).append(name)
    return found


def unit_of_time(name: str) -> str:
    """Returns the unit of time in the name of a column; "" if there is none."""
    return next((word for word in words_of(name) if word in ("ms", "us", "ns")), "")


def _vectors(names: Sequence[str]) -> dict[str, dict[str, tuple[str, ...]]]:
    groups: dict[tuple[str, bool], dict[str, str]] = {}
    for name in names:
        if match := _COMPONENT.fullmatch(name):
            axis = match["axis"].lower()
            groups.setdefault((match["group"], axis.isdecimal()), {}).setdefault(axis, name)
    found: dict[str, dict[str, tuple[str, ...]]] = {"base": {}, "imu": {}}
    for (group, numbered), axes in groups.items():
        if is_command(group) or is_touch(group):
            continue
        words = set(words_of(group)) or {"p"}
        for quantity, known in _VECTORS.items():
            width = 4 if quantity == "orientation" else 3
            order = "0123"[:width] if numbered else "wxyz"[-width:]
            fitting = known - {"q", "w"} if numbered else known
            if numbered and quantity not in _NUMBERED:
                continue
            if words.intersection(fitting) and set(axes) == set(order):
                body = "imu" if words & _OTHERS["imu"] else "base"
                if quantity in VECTORS[body]:
                    found[body].setdefault(quantity, tuple(axes[axis] for axis in order))
                break
    return found


def is_command(name: str) -> bool:
    """Returns whether a name has a word of commands, such as ``/lowcmd`` and ``q_des``."""
    return _COMMANDS.search(" ".join(words_of(name))) is not None


def is_touch(name: str) -> bool:
    """Returns whether a name may be that of a contact: it has a word such as ``foot``."""
    touch = any(_WORDS.get(word, (word,)) == ("touch",) for word in words_of(name))
    return touch and not is_command(name)


def quantity_of(name: str) -> str:
    """Returns what is measured or commanded, such as ``velocity``; "" if a name does not say."""
    words = set(words_of(name))
    quantities = list(_QUANTITIES.items())[1:]
    return next((quantity for quantity, known in quantities if known & words), "")
