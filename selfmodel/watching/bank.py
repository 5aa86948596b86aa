"""A bank of single faults, whose losses since a change are kept up to date segment by segment."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.diagnosis import significance
from selfmodel.diagnosis.comparator import Comparator
from selfmodel.diagnosis.direct_evidence import observed_faults, standing_joints
from selfmodel.diagnosis.losses import LossTable
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.joints import LOCKED_LEG
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Trial, TrialPart
from selfmodel.watching.finding import Rated


class Bank:
    """Hypotheses of one fault about a robot that changed, and ``INTACT``.

    Jams are at the angles at which the encoders end, and legs of which all joints stand may be
    locked. The loss is that of the comparator plus that of the hinges that show the change: a fault
    of a joint changes the motion of that joint most. Hypotheses that are clearly worse than the
    best one are left out, and not simulated again.

    Args:
        simulator: The self-model.
        comparator: Comparator of the last segment of a trial.
        space: Hypotheses about the robot.
        since: The steps since the change, as a trial.
        usual: Losses of a healthy robot at the hinges that show the change, by column.
    """

    def __init__(
        self,
        simulator: Simulator,
        comparator: Comparator,
        space: HypothesisSpace,
        since: Trial,
        usual: Mapping[int, float],
    ) -> None:
        self._table, self._usual = LossTable(simulator, comparator), usual
        anatomy = space.anatomy
        standing = standing_joints([since], anatomy)
        observed = observed_faults([since], anatomy, standing)
        moving = {*LOCKED_LEG.parts(anatomy)} - {fault.part for fault in observed}
        space = replace(space, observed=observed).without(LOCKED_LEG, moving)
        self._left = [INTACT, *space.with_one_more(INTACT)]

    def remaining(self, segments: Sequence[TrialPart]) -> list[Rated]:
        """Returns the hypotheses that are not significantly worse than the best, best first.

        Of those that differ in severities alone, the best one is returned. ``segments`` are those
        since the change, all of them: what was simulated before is known.
        """
        losses = self._losses(self._left, segments)
        order = np.argsort(losses.sum(axis=1), kind="stable").tolist()
        best, rated, left = losses[order[0]], dict[object, Rated](), []
        for k in order:
            one, lead = self._left[k], significance.lead(best, losses[k])
            if lead < significance.MIN_Z:
                rated.setdefault(one.without_severities, Rated(one, float(losses[k].mean())))
            if lead < significance.MIN_Z_OF_CHANGE:
                left.append(one)
        self._left = left
        return list(rated.values())

    def intact_loss(self, segments: Sequence[TrialPart]) -> float:
        """Returns the mean loss without a fault."""
        return float(self._losses([INTACT], segments).mean())

    def _losses(
        self, hypotheses: Sequence[Hypothesis], segments: Sequence[TrialPart]
    ) -> FloatArray:
        losses = self._table.losses(hypotheses, segments)
        by_hinge = self._table.by_hinge(hypotheses, segments)
        if by_hinge is not None:
            for column, usual in self._usual.items():  # a detached hinge is not predicted
                own = by_hinge[:, :, column]
                losses = losses + np.where(np.isnan(own), usual, own)
        return losses
