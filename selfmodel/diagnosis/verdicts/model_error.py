"""Model error: a fault corrects the self-model if it improves the healthy trials as well."""

from itertools import combinations

from selfmodel.diagnosis.loss_functions import LossFunctions
from selfmodel.diagnosis.verdicts.significance import gain_is_model_error
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace


def is_model_error(
    hypothesis: Hypothesis, fewer: Hypothesis, losses: LossFunctions, space: HypothesisSpace
) -> bool:
    """Returns whether extra faults improve the healthy trials about as much as the damaged ones.

    Args:
        hypothesis: The hypothesis with the extra faults.
        fewer: The hypothesis without the extra faults.
        losses: Loss functions of the trials.
        space: The hypotheses about the robot.

    Returns:
        False if there are no comparable healthy trials.
    """
    if losses.healthy is None:
        return False
    extra = [fault for fault in hypothesis.faults if fault not in fewer.faults]
    healthy_with, healthy_without = losses.healthy([space.canonical(extra), INTACT])
    # Most faults worsen the healthy trials; their losses on the damaged trials are not needed.
    if not healthy_with.mean() < healthy_without.mean():
        return False
    damaged_with, damaged_without = losses.damaged([hypothesis, fewer])
    return gain_is_model_error(damaged_with, damaged_without, healthy_with, healthy_without)


def any_fault_is_model_error(
    hypothesis: Hypothesis, losses: LossFunctions, space: HypothesisSpace
) -> bool:
    """Returns whether at least one fault of a hypothesis corrects model error.

    Args:
        hypothesis: In canonical form.
        losses: Loss functions of the trials.
        space: The hypotheses about the robot.
    """
    return any(
        is_model_error(hypothesis, space.canonical(rest), losses, space)
        for rest in combinations(hypothesis.faults, max(len(hypothesis) - 1, 0))
    )
