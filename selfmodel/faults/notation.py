"""Hypotheses as text: ``break:front_left_knee+friction=0.4``; ``intact`` for none.

A hypothesis prints itself in the same notation, and what it prints parses back to it.
"""

import math
from collections.abc import Iterable

from selfmodel.errors import InputError, unknown_name
from selfmodel.faults.hypothesis import INTACT, Hypothesis, canonical
from selfmodel.faults.kind import WORLD, Fault, Kind
from selfmodel.faults.registry import KINDS
from selfmodel.robot.anatomy import Anatomy


def parse(text: str, anatomy: Anatomy, kinds: Iterable[Kind] = tuple(KINDS.values())) -> Hypothesis:
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
            if _place(earlier) == _place(fault) and earlier.degree != fault.degree:
                raise InputError(
                    f"{text!r} gives {fault.kind.word}{':' if fault.part else ''}{fault.part} two "
                    f"degrees, {earlier.degree!r} and {fault.degree!r}: keep one of the terms"
                )
    return canonical(faults, anatomy)


def _place(fault: Fault) -> tuple[str, str, str]:
    """What a hypothesis can say one degree of."""
    return fault.kind.word, fault.part, fault.kind.prefix


def _fault(term: str, text: str, anatomy: Anatomy, known: tuple[Kind, ...]) -> Fault:
    head, equals, value = term.partition("=")
    word, colon, part = head.partition(":")
    if not word or (colon and not part):
        raise _unreadable(term, text, known)
    words = dict.fromkeys(kind.word for kind in known)
    if word not in words:
        if not colon and not equals:
            raise _unreadable(term, text, known)
        raise unknown_name(f"kind of fault in the term {term!r} of {text!r}", word, words)
    named = [kind for kind in known if kind.word == word]
    if not colon and WORLD not in {part for kind in named for part in kind.parts(anatomy)}:
        raise _unreadable(term, text, known)
    kind = _graded(term, named, value) if equals else _plain(named)
    parts = kind.parts(anatomy)
    if part not in parts:
        if parts == (WORLD,):
            raise InputError(f"the term {term!r} names a part, but {word} has none: write no ':'")
        raise unknown_name(f"part in the term {term!r} of {text!r}: for {word}", part, parts)
    if kind.degrees is None:
        return Fault(kind, part)
    return Fault(kind, part, _degree(term, kind, part, value, anatomy))


def _unreadable(term: str, text: str, known: tuple[Kind, ...]) -> InputError:
    words = dict.fromkeys(kind.word for kind in known)
    return InputError(
        f"cannot read the term {term!r} of {text!r}: expected kind:part, kind:part=degree or "
        f"kind=degree, with a kind of {', '.join(words)}, or 'intact' alone"
    )


def _plain(named: list[Kind]) -> Kind:
    """The kind that a term without a degree is of; one that needs a degree if there is no other."""
    return next((kind for kind in named if kind.degrees is None), named[0])


def _graded(term: str, named: list[Kind], value: str) -> Kind:
    """The kind that a term with a degree is of, by the prefix of the degree."""
    graded = sorted(
        (kind for kind in named if kind.degrees), key=lambda kind: len(kind.prefix), reverse=True
    )
    for kind in graded:
        if value.startswith(kind.prefix):
            return kind
    if not graded:
        raise InputError(
            f"the term {term!r} has a degree, but {named[0].word} knows none: write no '='"
        )
    prefixes = " or ".join(kind.prefix for kind in graded)
    raise InputError(f"the term {term!r} needs {prefixes} after '=' and then a number")


def _degree(term: str, kind: Kind, part: str, value: str, anatomy: Anatomy) -> float:
    if kind.degrees is None:
        raise ValueError(f"{kind.name} knows no degrees")
    lowest, highest = kind.degrees(anatomy, part)
    number = value.removeprefix(kind.prefix)
    try:
        degree = float(number)
    except ValueError:
        degree = math.nan
    if not lowest <= degree <= highest:
        raise InputError(
            f"the term {term!r} needs a number from {lowest:.4g} to {highest:.4g} {kind.unit} "
            f"after '={kind.prefix}', got {number!r}"
        )
    return degree + 0.0  # -0.0 and 0.0 are one degree
