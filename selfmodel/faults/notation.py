"""Parser of hypotheses as text: ``break:front_left_knee+friction=0.4``; ``intact`` for none.

``str(hypothesis)`` is the inverse: its result parses to the same hypothesis.
"""

import math
from collections.abc import Iterable, Mapping

from selfmodel.errors import InputError, unknown_name
from selfmodel.faults.hypothesis import INTACT, Hypothesis, canonical
from selfmodel.faults.kind import ENVIRONMENT, Fault, FaultKind
from selfmodel.faults.registry import KINDS
from selfmodel.robot.anatomy import Anatomy

MAX_LENGTH = 20_000
"""Maximum length of a notation, characters: some 500 faults."""

ROUNDING = 1e-4
"""Distance from its bounds at which a severity is the bound: a search rounds severities to four
decimals, and the bounds of a calibrated model have six digits."""


def parse(
    text: str, anatomy: Anatomy, kinds: Iterable[FaultKind] = tuple(KINDS.values())
) -> Hypothesis:
    """Returns the hypothesis of a notation, in canonical form.

    It is terms ``kind:part``, ``kind:part=severity`` or ``kind=severity`` joined by ``+``, with
    names among ``kinds``; or ``intact``. A locked leg may have an angle a hinge,
    ``leg:front_left=locked0.1/-0.8``.

    Raises:
        InputError: A term is malformed, names an unknown kind or part, or has a severity outside
            the bounds; the message contains the term.
    """
    if text.strip() == str(INTACT):
        return INTACT
    accepted = tuple(kinds)
    if len(text) > MAX_LENGTH:
        raise InputError(
            f"expected a hypothesis of at most {MAX_LENGTH} characters, got {len(text)}: a robot "
            f"has fewer parts"
        )
    faults = [_fault(term.strip(), text, anatomy, accepted) for term in text.split("+")]
    first: dict[tuple[str, str, str], Fault] = {}
    for fault in faults:
        kind, part = fault.kind, fault.part
        earlier = first.setdefault((kind.keyword, part, kind.prefix), fault)
        if earlier != fault:
            raise InputError(
                f"{text!r} gives {kind.keyword}{':' if part else ''}{part} two severities, "
                f"{earlier} and {fault}: keep one of the terms"
            )
    return canonical(faults, anatomy)


def _fault(term: str, text: str, anatomy: Anatomy, kinds: tuple[FaultKind, ...]) -> Fault:
    head, equals, value = term.partition("=")
    word, colon, part = head.partition(":")
    if not word or (colon and not part):
        raise _unreadable(term, text, kinds)
    words = dict.fromkeys(kind.keyword for kind in kinds)
    if word not in words:
        if not colon and not equals:
            raise _unreadable(term, text, kinds)
        raise unknown_name(f"kind of fault in the term {term!r} of {text!r}", word, words)
    named = [kind for kind in kinds if kind.keyword == word]
    if not colon and ENVIRONMENT not in {part for kind in named for part in kind.parts(anatomy)}:
        raise _unreadable(term, text, kinds)
    # Without a severity, the kind that has none, if any.
    plain = next((kind for kind in named if kind.bounds is None), named[0])
    kind = _of_value(term, named, value) if equals else plain
    parts = kind.parts(anatomy)
    if part not in parts:
        if parts == (ENVIRONMENT,):
            raise InputError(f"the term {term!r} names a part, but {word} has none: write no ':'")
        raise unknown_name(f"part in the term {term!r} of {text!r}: for {word}", part, parts)
    bounds = kind.bounds_at(anatomy, part)
    if bounds is None:
        return Fault(kind, part, angles=_angles(term, kind, kind.hinges(anatomy, part), value))
    return Fault(kind, part, _severity(term, kind, bounds, value))


def _unreadable(term: str, text: str, kinds: tuple[FaultKind, ...]) -> InputError:
    words = dict.fromkeys(kind.keyword for kind in kinds)
    return InputError(
        f"cannot read the term {term!r} of {text!r}: expected kind:part, kind:part=severity or "
        f"kind=severity, with a kind of {', '.join(words)}, or 'intact' alone"
    )


def _of_value(term: str, named: list[FaultKind], value: str) -> FaultKind:
    """Returns the kind of a term with a severity or angles, by the prefix of these."""
    valued = [kind for kind in named if kind.bounds or kind.prefix]
    valued.sort(key=lambda kind: -len(kind.prefix))
    for kind in valued:
        if value.startswith(kind.prefix):
            return kind
    if not valued:
        raise InputError(
            f"the term {term!r} has a severity, but {named[0].keyword} has none: write no '='"
        )
    prefixes = " or ".join(kind.prefix for kind in valued)
    number = " and then a number" if any(kind.bounds for kind in valued) else ""
    raise InputError(f"the term {term!r} needs {prefixes} after '='{number}")


def _angles(
    term: str, kind: FaultKind, hinges: Mapping[str, tuple[float, float]], value: str
) -> tuple[float, ...]:
    text = value.removeprefix(kind.prefix)
    numbers = text.split("/") if text else []
    if len(numbers) not in (0, len(hinges)):
        raise InputError(
            f"the term {term!r} needs no angle, or one, rad, for each of {', '.join(hinges)}, with "
            f"/ between them, got {text!r}"
        )
    return tuple(
        _severity(f"{term}, {hinge}", kind, limits, number)
        for number, (hinge, limits) in zip(numbers, hinges.items(), strict=False)
    )


def _severity(term: str, kind: FaultKind, bounds: tuple[float, float], value: str) -> float:
    lowest, highest = bounds
    number = value.removeprefix(kind.prefix)
    try:
        severity = float(number)
    except ValueError:
        severity = math.nan
    if not lowest - ROUNDING <= severity <= highest + ROUNDING:
        raise InputError(
            f"the term {term!r} needs a number from {lowest:.4g} to {highest:.4g} {kind.unit} "
            f"after '={kind.prefix}', got {number!r}"
        )
    return min(max(severity, lowest), highest) + 0.0  # -0.0 and 0.0 are one severity
