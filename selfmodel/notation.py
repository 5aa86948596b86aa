"""Hypotheses as text: ``break:front_left_knee+sensor:back_left_touch``; ``intact`` for none.

A hypothesis prints itself in the same notation, and what it prints parses back to it.
"""

import math

from selfmodel.anatomy import Anatomy
from selfmodel.errors import InputError, unknown_name
from selfmodel.faults import KINDS, Fault, Kind
from selfmodel.hypothesis import INTACT, Hypothesis, canonical


def parse(text: str, anatomy: Anatomy) -> Hypothesis:
    """Returns the hypothesis that ``text`` notes, in canonical form.

    Args:
        text: Terms ``kind:part`` or ``kind:part=degree`` joined by ``+``, or ``intact``.
        anatomy: The robot whose parts are named.

    Raises:
        InputError: A term is malformed, names something unknown, or has a degree that its part
            cannot have; the message names the term.
    """
    if text.strip() == str(INTACT):
        return INTACT
    faults = [_fault(term.strip(), text, anatomy) for term in text.split("+")]
    for index, fault in enumerate(faults):
        for earlier in faults[:index]:
            same_part = (earlier.kind, earlier.part) == (fault.kind, fault.part)
            if same_part and earlier.degree != fault.degree:
                raise InputError(
                    f"{text!r} gives {fault.kind}:{fault.part} two degrees, {earlier.degree!r} and "
                    f"{fault.degree!r}: keep one of the terms"
                )
    return canonical(faults, anatomy)


def _fault(term: str, text: str, anatomy: Anatomy) -> Fault:
    name, colon, rest = term.partition(":")
    part, equals, number = rest.partition("=")
    if not colon or not name or not part:
        raise InputError(
            f"cannot read the term {term!r} of {text!r}: expected kind:part or kind:part=degree, "
            f"with a kind of {', '.join(KINDS)}, or 'intact' alone"
        )
    if name not in KINDS:
        raise unknown_name(f"kind of fault in the term {term!r} of {text!r}", name, KINDS)
    kind = KINDS[name]
    if part not in kind.parts(anatomy):
        raise unknown_name(
            f"part in the term {term!r} of {text!r}: for {name}", part, kind.parts(anatomy)
        )
    degree = _degree(term, kind, part, number, anatomy) if equals else 0.0
    return Fault(name, part, degree)


def _degree(term: str, kind: Kind, part: str, number: str, anatomy: Anatomy) -> float:
    if kind.degrees is None:
        raise InputError(
            f"the term {term!r} has a degree, but {kind.name} knows none: write no '='"
        )
    lowest, highest = kind.degrees(anatomy, part)
    try:
        degree = float(number)
    except ValueError:
        degree = math.nan
    if not lowest <= degree <= highest:
        raise InputError(
            f"the term {term!r} needs a number from {lowest:.4g} to {highest:.4g} {kind.unit} "
            f"after '=', got {number!r}"
        )
    return degree + 0.0  # -0.0 and 0.0 are one degree
