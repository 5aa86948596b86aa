"""The question of a diagnosis: trials to explain, and the losses of hypotheses about them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.diagnosis.evidence import Evidence
from selfmodel.diagnosis.joint_losses import JointLosses
from selfmodel.diagnosis.loss_functions import Losses, LossFunctions
from selfmodel.diagnosis.search.observed_jams import observed_jams
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.trials.trial import Trial, TrialPart, observed_as, whole


@dataclass(frozen=True, eq=False)
class Question:
    """Trials to explain, and the losses of hypotheses about them.

    Attributes:
        evidence: Distances of hypotheses from trials.
        space: The hypotheses about the robot.
        trials: Trials to explain, or parts of them.
        names: Names of the trials of the whole diagnosis, by path.
        intact: Trials of the healthy robot, or parts of them.
        kept: Number of hypotheses in a ranking.
        losses: Loss functions of the trials.
        joints: Losses of single joints; None if the comparator has none.
    """

    evidence: Evidence
    space: HypothesisSpace
    trials: Sequence[Trial | TrialPart]
    names: Mapping[str, str]
    intact: Sequence[Trial | TrialPart]
    kept: int
    losses: LossFunctions
    joints: JointLosses | None = None

    @property
    def logs(self) -> list[str]:
        """Paths of the trials' logs."""
        return [whole(trial).trial.path for trial in self.trials]

    @property
    def healthy_losses(self) -> FloatArray | None:
        """Losses of the empty hypothesis on healthy trials, ``(pieces,)``; None without any.

        Encoders that are lost in the trials to explain are left out of the healthy ones.
        """
        if not self.intact:
            return None
        reference = _reference(self.intact, self.trials)
        return np.asarray(self.evidence.losses([INTACT], reference)[0])


def question_of(
    evidence: Evidence,
    space: HypothesisSpace,
    trials: Sequence[Trial | TrialPart],
    *,
    names: Mapping[str, str],
    intact: Sequence[Trial | TrialPart],
    surrogate: Losses,
    kept: int,
) -> Question:
    """Returns the question of the hypothesis that explains some trials, or parts of them.

    Jams at the angles at which the encoders end are added to the hypotheses. Closed-loop windows
    are correlated, so losses on them are not compared with losses on healthy trials.

    Args:
        evidence: Distances of hypotheses from trials.
        space: The hypotheses about the robot.
        trials: Trials to explain, or parts of them.
        names: Names of the trials of the whole diagnosis, by path.
        intact: Trials of the healthy robot, or parts of them.
        surrogate: Losses of the surrogate comparator on the trials to explain.
        kept: Number of hypotheses in a ranking.
    """
    jams = observed_jams([whole(trial).rows for trial in trials], space.anatomy)
    known = [whole(trial).trial for trial in (*intact, *trials)]
    is_piecewise = evidence.is_piecewise(known)
    compared = intact if is_piecewise and evidence.uses_segments(known) else ()
    return Question(
        evidence=evidence,
        space=replace(space, observed=jams),
        trials=trials,
        names=names,
        intact=intact,
        kept=kept,
        losses=LossFunctions(
            damaged=partial(evidence.losses, trials=trials),
            surrogate=surrogate,
            healthy=partial(evidence.losses, trials=compared) if compared else None,
        ),
        joints=_joint_losses(evidence, space, trials, compared)
        if evidence.predicts_hinges(known)
        else None,
    )


def _joint_losses(
    evidence: Evidence,
    space: HypothesisSpace,
    trials: Sequence[Trial | TrialPart],
    intact: Sequence[Trial | TrialPart],
) -> JointLosses:
    reference = _reference(intact, trials)
    return JointLosses(
        space.anatomy,
        damaged=partial(evidence.losses_by_hinge, trials=trials),
        healthy=partial(evidence.losses_by_hinge, trials=reference) if reference else None,
    )


def _reference(
    intact: Sequence[Trial | TrialPart], trials: Sequence[Trial | TrialPart]
) -> list[TrialPart]:
    """Returns healthy trials without the encoders that are lost in the trials to explain."""
    observed = [whole(trial).trial for trial in trials]
    return [replace(part, trial=observed_as(part.trial, observed)) for part in map(whole, intact)]
