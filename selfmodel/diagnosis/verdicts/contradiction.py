"""Evidence against a fault that a log contains without any simulation.

A sensor whose reading changes has not failed. The loss of a comparator contains this only in part:
a model that predicts far too much contact at a foot is nearer to a sensor that never reads contact
than to one that seldom does.
"""

from collections.abc import Sequence

import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.trials.behaviour import Behaviour

CONTRADICTION = 5.0
"""Loss of a piece in which the log contradicts a fault: as much as a signal whose error is 12 times
its scale. One glitch in 80 pieces then costs 0.06, and strong evidence outweighs it."""


def contradiction_losses(
    hypotheses: Sequence[Hypothesis], behaviour: Behaviour, piece_steps: IndexArray
) -> FloatArray:
    """Returns the loss by contradictions of each hypothesis in each piece, ``(n, pieces)``.

    Args:
        hypotheses: Hypotheses about the trial.
        behaviour: The logged behaviour.
        piece_steps: First and last control step of each piece, ``(pieces, 2)``.
    """
    losses = np.zeros((len(hypotheses), len(piece_steps)))
    for row, hypothesis in zip(losses, hypotheses, strict=True):
        for fault in hypothesis.faults:
            steps = np.append(0, np.cumsum(fault.kind.contradicted(fault, behaviour)))
            is_contradicted = steps[piece_steps[:, 1] + 1] > steps[piece_steps[:, 0]]
            row[is_contradicted] += CONTRADICTION
    return losses
