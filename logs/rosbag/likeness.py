"""Which joint of a bag is meant by which of the model, when two people have named them."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import SequenceMatcher
from types import MappingProxyType

SURE = 0.75
"""Names that are so alike, of at most 1, mean the same, if no other comes near."""

ALIKE = 0.3
"""Names less alike than this are not even a guess."""

NEAR = 0.1
"""A second name that is less than this behind the best makes it a guess."""

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
        # What says nothing about which joint it is.
        **dict.fromkeys(("joint", "motor", "servo", "actuator", "link", "position"), ()),
    }
)


_SIDES = (frozenset({"front", "middle", "back"}), frozenset({"left", "right"}))
"""Two of one of these are never the same, however alike the rest is."""


@dataclass(frozen=True)
class Guess:
    """A name of the bag for one of the model.

    Attributes:
        name: Which.
        sure: Whether it is more than a guess.
    """

    name: str
    sure: bool


def matched(wanted: Sequence[str], offered: Sequence[str]) -> dict[str, Guess]:
    """Returns for each wanted name the offered one that is most like it, each used once.

    Order, case and the usual abbreviations do not matter: ``FL_calf_joint`` is much like
    ``front_left_knee``.

    Args:
        wanted: The model's names.
        offered: The bag's names.

    Returns:
        By the wanted name; names that nothing is like are left out.
    """
    scores = {(ours, theirs): likeness(ours, theirs) for ours in wanted for theirs in offered}
    found: dict[str, Guess] = {}
    used: set[str] = set()
    for (ours, theirs), score in sorted(scores.items(), key=lambda item: -item[1]):
        if score < ALIKE or ours in found or theirs in used:
            continue
        rivals = [
            other for pair, other in scores.items() if (pair[0] == ours) != (pair[1] == theirs)
        ]
        found[ours] = Guess(theirs, score >= SURE and score - max(rivals, default=0.0) >= NEAR)
        used.add(theirs)
    return found


def likeness(ours: str, theirs: str) -> float:
    """Returns how alike two names are: 0, nothing in common, to 1, the same words or initials."""
    if "".join(word[0] for word in _parts(ours)) == theirs.lower():
        return 1.0
    first, second = _words(ours), _words(theirs)
    if any((first & sides) and (second & sides) and not first & second & sides for sides in _SIDES):
        return 0.0
    common = len(first & second)
    words = 2 * common / (len(first) + len(second)) if first or second else 0.0
    letters = SequenceMatcher(None, "".join(sorted(first)), "".join(sorted(second))).ratio()
    return 0.9 * words + 0.1 * letters


def _words(name: str) -> frozenset[str]:
    return frozenset(word for part in _parts(name) for word in _WORDS.get(part, (part,)))


def _parts(name: str) -> list[str]:
    """``FLKnee_2`` is ``fl``, ``knee`` and ``2``."""
    return [part.lower() for part in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", name)]
