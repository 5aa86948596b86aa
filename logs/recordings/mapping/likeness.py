"""Matching of a bag's joint names to those of the model, by similarity."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import SequenceMatcher
from types import MappingProxyType

CERTAIN_SIMILARITY = 0.75
"""Minimum similarity of a certain match, of at most 1, if no other name is ``CERTAIN_LEAD``."""

MIN_SIMILARITY = 0.3
"""Minimum similarity of a match."""

CERTAIN_LEAD = 0.1
"""Minimum lead over the second most similar name of a certain match."""

LONGEST = 200
"""Length of the longest name that is compared, characters."""

_WORDS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        **dict.fromkeys(("fl", "lf"), ("front", "left")),
        **dict.fromkeys(("fr", "rf"), ("front", "right")),
        **dict.fromkeys(("ml", "lm"), ("middle", "left")),
        **dict.fromkeys(("mr", "rm"), ("middle", "right")),
        **dict.fromkeys(("bl", "lb", "hl", "lh", "rl"), ("back", "left")),
        **dict.fromkeys(("br", "rb", "hr", "rh", "rr"), ("back", "right")),
        **dict.fromkeys(("rear", "hind"), ("back",)),
        "fore": ("front",),
        "mid": ("middle",),
        "l": ("left",),
        "r": ("right",),
        **dict.fromkeys(("hfe", "thigh", "femur", "upper"), ("shoulder",)),
        **dict.fromkeys(("kfe", "calf", "shank", "tibia", "lower"), ("knee",)),
        "haa": ("hip",),
        **dict.fromkeys(("foot", "ft", "contact", "force", "wrench", "sole"), ("touch",)),
        # Words that do not identify a joint.
        **dict.fromkeys(("joint", "motor", "servo", "actuator", "link", "position"), ()),
    }
)


_SIDES = (frozenset({"front", "middle", "back"}), frozenset({"left", "right"}))
"""Sets of exclusive words: names with two words of one set never match."""


@dataclass(frozen=True)
class NameMatch:
    """Name in the bag that matches a name of the model.

    Attributes:
        name: Name in the bag.
        sure: Whether the match is certain.
    """

    name: str
    sure: bool


def matched(wanted: Sequence[str], offered: Sequence[str]) -> dict[str, NameMatch]:
    """Returns the most similar offered name for each wanted name, each used once.

    Order, case and the usual abbreviations do not matter: ``FL_calf_joint`` is similar to
    ``front_left_knee``.

    Args:
        wanted: Names of the model.
        offered: Names in the bag.

    Returns:
        Matches by wanted name; names without a match are left out.
    """
    scores = {(ours, theirs): likeness(ours, theirs) for ours in wanted for theirs in offered}
    found: dict[str, NameMatch] = {}
    used: set[str] = set()
    for (ours, theirs), score in sorted(scores.items(), key=lambda item: -item[1]):
        if score < MIN_SIMILARITY or ours in found or theirs in used:
            continue
        competing = [scores[ours, other] for other in offered if other != theirs]
        competing += [scores[other, theirs] for other in wanted if other != ours]
        found[ours] = NameMatch(
            theirs,
            score >= CERTAIN_SIMILARITY and score - max(competing, default=0.0) >= CERTAIN_LEAD,
        )
        used.add(theirs)
    return found


def likeness(ours: str, theirs: str) -> float:
    """Returns the similarity of two names, 0 to 1, which is 1 for the same words or initials.

    It is 0 for names longer than ``LONGEST``: its time is the square of their length.
    """
    if max(len(ours), len(theirs)) > LONGEST:
        return 0.0
    if "".join(word[0] for word in parts_of(ours)) == theirs.lower():
        return 1.0
    first, second = _words(ours), _words(theirs)
    if any((first & sides) and (second & sides) and not first & second & sides for sides in _SIDES):
        return 0.0
    common = len(first & second)
    words = 2 * common / (len(first) + len(second)) if first or second else 0.0
    letters = SequenceMatcher(None, "".join(sorted(first)), "".join(sorted(second))).ratio()
    return 0.9 * words + 0.1 * letters


def _words(name: str) -> frozenset[str]:
    return frozenset(word for part in parts_of(name) for word in _WORDS.get(part, (part,)))


def parts_of(name: str) -> list[str]:
    """Returns the words of a name: ``FLKnee_2`` has ``fl``, ``knee`` and ``2``."""
    return [part.lower() for part in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", name)]
