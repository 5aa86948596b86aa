"""Hypotheses as text: ``break:front_left_knee+friction=0.4``; ``intact`` for none.

A hypothesis prints itself in the same notation, and what it prints parses back to it.
"""

import math
from collections.abc import Iterable

from selfmodel.errors import InputError, unknown_name
from selfmodel.faults.hypothesis import INTACT, Hypothesis, canonical
from selfmodel.faults.kind import ENVIRONMENT, Fault, FaultKind
from selfmodel.faults.registry import KINDS
from selfmodel.robot.anatomy import Anatomy


def parse(
    text: str, anatomy: Anatomy, kinds: Iterable[FaultKind] = tuple(KINDS.values())
) -> Hypothesis:
    """Returns the hypothesis that ``text`` notes, in canonical form.

    Args:
        text: Terms ``kind:part``, ``kind:part=degree`` or ``kind=degree`` joined by ``+``, or
            ``intact``.
        anatomy: The robot whose parts are named.
        kinds: Those that a term may be of.

    Raises:
        InputError: A term is malformed, names something unknown, or has a degree that its part
            cannot have; the message names the term.
    """
    if text.strip() == str(INTACT):
        return INTACT
    known = tuple(kinds)
    faults = [_fault(term.strip(), text, anatomy, known) for term in text.split("+")]
    for index, fault in enumerate(faults):
        for earlier in faults[:index]:
            if _place(earlier) == _place(fault) and earlier.severity != fault.severity:
                raise InputError(
                    f"{text!r} gives {fault.kind.keyword}{':' if fault.part else ''}{fault.part} "
                    f"two degrees, {earlier.severity!r} and {fault.severity!r}: keep one of the "
                    f"terms"
                )
    return canonical(faults, anatomy)


def _place(fault: Fault) -> tuple[str, str, str]:
    """What a hypothesis can say one degree of."""
    return fault.kind.keyword, fault.part, fault.kind.prefix


def _fault(term: str, text: str, anatomy: Anatomy, known: tuple[FaultKind, ...]) -> Fault:
    head, equals, value = term.partition("=")
    word, colon, part = head.partition(":")
    if not word or (colon and not part):
        raise _unreadable(term, text, known)
    words = dict.fromkeys(kind.keyword for kind in known)
    if word not in words:
        if not colon and not equals:
            raise _unreadable(term, text, known)
        raise unknown_name(f"kind of fault in the term {term!r} of {text!r}", word, words)
    named = [kind for kind in known if kind.keyword == word]
    if not colon and ENVIRONMENT not in {part for kind in named for part in kind.parts(anatomy)}:
        raise _unreadable(term, text, known)
    kind = _graded(term, named, value) if equals else _plain(named)
    parts = kind.parts(anatomy)
    if part not in parts:
        if parts == (ENVIRONMENT,):
            raise InputError(f"the term {term!r} names a part, but {word} has none: write no ':'")
        raise unknown_name(f"part in the term {term!r} of {text!r}: for {word}", part, parts)
    if kind.severity_bounds is None:
        return Fault(kind, part)
    return Fault(kind, part, _degree(term, kind, part, value, anatomy))


def _unreadable(term: str, text: str, known: tuple[FaultKind, ...]) -> InputError:
    words = dict.fromkeys(kind.keyword for kind in known)
    return InputError(
        f"cannot read the term {term!r} of {text!r}: expected kind:part, kind:part=degree or "
        f"kind=degree, with a kind of {', '.join(words)}, or 'intact' alone"
    )


def _plain(named: list[FaultKind]) -> FaultKind:
    """The kind that a term without a degree is of; one that needs a degree if there is no other."""
    return next((kind for kind in named if kind.severity_bounds is None), named[0])


def _graded(term: str, named: list[FaultKind], value: str) -> FaultKind:
    """The kind that a term with a degree is of, by the prefix of the degree."""
    graded = sorted(
        (kind for kind in named if kind.severity_bounds),
        key=lambda kind: len(kind.prefix),
        reverse=True,
    )
    for kind in graded:
        if value.startswith(kind.prefix):
            return kind
    if not graded:
        raise InputError(
            f"the term {term!r} has a degree, but {named[0].keyword} knows none: write no '='"
        )
    prefixes = " or ".join(kind.prefix for kind in graded)
    raise InputError(f"the term {term!r} needs {prefixes} after '=' and then a number")


def _degree(term: str, kind: FaultKind, part: str, value: str, anatomy: Anatomy) -> float:
    if kind.severity_bounds is None:
        raise ValueError(f"{kind.name} knows no degrees")
    lowest, highest = kind.severity_bounds(anatomy, part)
    number = value.removeprefix(kind.prefix)
    try:
        severity = float(number)
    except ValueError:
        severity = math.nan
    if not lowest <= severity <= highest:
        raise InputError(
            f"the term {term!r} needs a number from {lowest:.4g} to {highest:.4g} {kind.unit} "
            f"after '={kind.prefix}', got {number!r}"
        )
    return severity + 0.0  # -0.0 and 0.0 are one degree
