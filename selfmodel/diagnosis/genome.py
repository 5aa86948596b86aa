"""The diagnostic genome: genes of four values, and the hypotheses that they encode.

Source: the paper, section III (diagnostic EA): four genes, each of which says whether it is
active, which kind of failure, of which part, and how severe; the paper leaves the last unused.
"""

from collections.abc import Sequence

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import Hypothesis, canonical
from selfmodel.faults.kind import Fault, FaultKind
from selfmodel.faults.registry import PAPER_KINDS
from selfmodel.robot.anatomy import Anatomy

VALUES = 4
"""Values of a gene, each in [0, 1): active from 0.5 on, kind, part, degree."""


def decode(
    genome: FloatArray, anatomy: Anatomy, kinds: Sequence[FaultKind] = PAPER_KINDS
) -> Hypothesis:
    """Returns the hypothesis that a genome encodes.

    Args:
        genome: ``(genes * 4,)`` values in [0, 1).
        anatomy: The robot whose parts the third values choose from.
        kinds: What the second values choose from; the fourth choose from a kind's levels.
    """
    faults = []
    for active, kind_value, part_value, degree_value in genome.reshape(-1, VALUES):
        if active >= 0.5:
            kind = kinds[int(kind_value * len(kinds))]
            parts = kind.parts(anatomy)
            part = parts[int(part_value * len(parts))]
            levels = kind.levels(anatomy, part)
            faults.append(Fault(kind, part, levels[int(degree_value * len(levels))]))
    return canonical(faults, anatomy)


def encode(
    hypothesis: Hypothesis, genes: int, anatomy: Anatomy, kinds: Sequence[FaultKind] = PAPER_KINDS
) -> FloatArray:
    """Returns a genome of ``(genes * 4,)`` values that decodes to ``hypothesis``.

    A degree that is none of its kind's levels becomes the nearest one, so that a hypothesis whose
    degrees were refined can still seed a search.

    Raises:
        InputError: There are more faults than genes, or one that no genome can express.
    """
    if len(hypothesis) > genes:
        raise InputError(
            f"a genome of {genes} genes has no room for the {len(hypothesis)} faults of "
            f"{hypothesis}"
        )
    genome = np.full((genes, VALUES), 0.25)
    for gene, fault in zip(genome, hypothesis.faults, strict=False):
        if fault.kind not in kinds:
            raise InputError(
                f"no diagnostic genome can express {fault}: the kinds considered are "
                f"{', '.join(kind.name for kind in kinds)}"
            )
        parts = fault.kind.parts(anatomy)
        levels = fault.kind.levels(anatomy, fault.part)
        nearest = int(np.argmin(np.abs(np.array(levels) - fault.severity)))
        gene[:] = (
            0.75,
            _middle(kinds.index(fault.kind), len(kinds)),
            _middle(parts.index(fault.part), len(parts)),
            _middle(nearest, len(levels)),
        )
    return genome.ravel()


def _middle(index: int, count: int) -> float:
    """The middle of its interval: floor of the product gives the index back exactly."""
    return (index + 0.5) / count
