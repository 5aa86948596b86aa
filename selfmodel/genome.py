"""The diagnostic genome: genes of four values, and the hypotheses that they encode.

Source: the paper, section III (diagnostic EA): four genes, each of which says whether it is
active, which kind of failure, of which part, and how severe.
"""

import numpy as np

from selfmodel.anatomy import Anatomy
from selfmodel.arrays import FloatArray
from selfmodel.errors import InputError
from selfmodel.faults import KINDS, Fault, Kind
from selfmodel.hypothesis import Hypothesis, canonical

VALUES = 4
"""Values of a gene, each in [0, 1): active from 0.5 on, kind, part, degree."""


def hypothesised_kinds() -> tuple[Kind, ...]:
    """Returns the kinds that a diagnosis may propose, in the order of the gene's second value."""
    return tuple(kind for kind in KINDS.values() if kind.hypothesised)


def decode(genome: FloatArray, anatomy: Anatomy) -> Hypothesis:
    """Returns the hypothesis that a genome encodes.

    Args:
        genome: ``(genes * 4,)`` values in [0, 1).
        anatomy: The robot whose parts the third values choose from.
    """
    kinds = hypothesised_kinds()
    faults = []
    for active, kind_value, part_value, _degree in genome.reshape(-1, VALUES):
        if active >= 0.5:
            kind = kinds[int(kind_value * len(kinds))]
            parts = kind.parts(anatomy)
            faults.append(Fault(kind.name, parts[int(part_value * len(parts))]))
    return canonical(faults, anatomy)


def encode(hypothesis: Hypothesis, genes: int, anatomy: Anatomy) -> FloatArray:
    """Returns a genome of ``(genes * 4,)`` values that decodes to ``hypothesis``.

    Raises:
        InputError: There are more faults than genes, or one that no genome can express.
    """
    if len(hypothesis) > genes:
        raise InputError(
            f"a genome of {genes} genes has no room for the {len(hypothesis)} faults of "
            f"{hypothesis}"
        )
    kinds = hypothesised_kinds()
    genome = np.full((genes, VALUES), 0.25)
    for gene, fault in zip(genome, hypothesis.faults, strict=False):
        kind = KINDS[fault.kind]
        if kind not in kinds or fault.degree:
            raise InputError(f"no diagnostic genome can express {fault}")
        parts = kind.parts(anatomy)
        # The middle of its interval: floor of the product gives the index back exactly.
        gene[:3] = (
            0.75,
            (kinds.index(kind) + 0.5) / len(kinds),
            (parts.index(fault.part) + 0.5) / len(parts),
        )
    return genome.ravel()
