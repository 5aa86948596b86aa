"""Which faults only mend the self-model: they would have helped before anything was wrong."""

from itertools import combinations

from selfmodel.diagnosis.loss_functions import LossFunctions
from selfmodel.diagnosis.significance import gain_is_model_error
from selfmodel.faults.hypothesis import INTACT, Hypothesis, canonical
from selfmodel.robot.anatomy import Anatomy


def is_model_error(
    hypothesis: Hypothesis, fewer: Hypothesis, looks: LossFunctions, anatomy: Anatomy
) -> bool:
    """Returns whether what a hypothesis says more than another would have helped before as well.

    Args:
        hypothesis: The one that says more.
        fewer: The other.
        looks: How badly they predict the trials.
        anatomy: The robot's parts.

    Returns:
        False where there is nothing from before to compare with.
    """
    if looks.before is None:
        return False
    more = [fault for fault in hypothesis.faults if fault not in fewer.faults]
    with_it, without = looks.before([canonical(more, anatomy), INTACT])
    # Most faults would have done harm, and of those nothing is simulated.
    if not with_it.mean() < without.mean():
        return False
    with_more, with_fewer = looks.after([hypothesis, fewer])
    return gain_is_model_error(with_more, with_fewer, with_it, without)


def any_fault_is_model_error(
    hypothesis: Hypothesis, looks: LossFunctions, anatomy: Anatomy
) -> bool:
    """Returns whether one of the faults of a hypothesis would have helped before as well.

    Args:
        hypothesis: What may be wrong.
        looks: How badly hypotheses predict the trials.
        anatomy: The robot's parts.
    """
    return any(
        is_model_error(hypothesis, canonical(rest, anatomy), looks, anatomy)
        for rest in combinations(hypothesis.faults, max(len(hypothesis) - 1, 0))
    )
