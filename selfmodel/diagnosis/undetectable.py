"""What may be wrong besides: faults that the trials neither show nor rule out."""

from collections.abc import Sequence

import numpy as np

from selfmodel.diagnosis.loss_functions import Losses, LossFunctions
from selfmodel.diagnosis.significance import is_better
from selfmodel.faults.hypothesis import Hypothesis, canonical
from selfmodel.faults.kind import FaultKind
from selfmodel.robot.anatomy import Anatomy


def undetectable_faults(
    best: Hypothesis, kinds: Sequence[FaultKind], anatomy: Anatomy, looks: LossFunctions
) -> list[Hypothesis]:
    """Returns the hypotheses of one fault more that the trials cannot tell from the best.

    A dead touch sensor is one, in a foot that the gait never put down. Faults of degree are left
    out: of most there is one that is too slight to be seen.

    Args:
        best: The best hypothesis.
        kinds: What is considered.
        anatomy: The robot's parts.
        looks: How badly hypotheses predict the trials. What the screen can tell is not looked at
            closely.

    Returns:
        Closest first; none where the best itself diverges.
    """
    exact = [kind for kind in kinds if kind.severity_bounds is None]
    faults = [fault for kind in exact for fault in kind.candidates(anatomy)]
    made = dict.fromkeys(canonical([*best.faults, fault], anatomy) for fault in faults)
    more = [one for one in made if len(one) > len(best)]
    few = _untold(best, _untold(best, more, looks.screen), looks.after)
    order = np.argsort(looks.after(few).sum(axis=1), kind="stable") if few else ()
    return [few[i] for i in order]


def _untold(best: Hypothesis, others: Sequence[Hypothesis], losses: Losses) -> list[Hypothesis]:
    mine, *theirs = losses([best, *others])
    if not np.isfinite(mine).all():
        return []
    return [
        other
        for other, row in zip(others, theirs, strict=True)
        if not is_better(mine, row) and not is_better(row, mine)
    ]
