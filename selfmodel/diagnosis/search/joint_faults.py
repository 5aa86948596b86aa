"""Faults of single joints, decided by the motion of the joint itself.

The search before this one compares losses over all signals. A small fault of a joint is lost in
them, and so is the difference between kinds with similar effects: dry friction, damping, a weak
motor, a jam. The joint's own motion contains both. On 120 recordings of another generator with one
such fault, the loss of the joint was 4 to 50 standard errors above that in the healthy trial; in 24
recordings of healthy robots, no joint's was above 2.1.

The joints with a fault in the hypothesis are visited first, then, as long as a fault is added, the
joint with the largest excess over the healthy trials. At each, the best fault by the sum of the
total loss and the joint's loss is chosen.
"""

from collections.abc import Sequence

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.diagnosis.joint_losses import JointLosses, joint_is_better, known
from selfmodel.diagnosis.loss_functions import Losses
from selfmodel.diagnosis.search.severity import with_fitted_severity
from selfmodel.diagnosis.verdicts.significance import (
    MIN_Z_OF_JOINT,
    gain_exceeds_healthy_gain,
    is_better,
)
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace

MIN_EXCESS = 2.0
"""Standard errors by which the loss of a joint has to exceed that in healthy trials for a fault of
the joint to be searched. It is lower than ``MIN_Z_OF_JOINT``, because the gain of a fault is paired
over the pieces and so tested more sharply than the excess."""

KINDS_FITTED = 3
"""Kinds whose severities are fitted between their levels, best first."""


def with_joint_faults(
    best: Hypothesis,
    space: HypothesisSpace,
    max_faults: int,
    losses: Losses,
    joints: JointLosses,
) -> Hypothesis:
    """Returns a hypothesis with its faults of single joints decided by the joints' own motion.

    A fault replaces those of the same joint if the motion of the joint is predicted significantly
    better, and the trials not significantly worse. A fault of a further joint is added if, besides,
    the gain exceeds that on healthy trials, and the excess of the joint is gone.

    Args:
        best: The best hypothesis by the total loss.
        space: The hypotheses about the robot.
        max_faults: Maximum number of faults of a hypothesis.
        losses: Losses of hypotheses on the trials to explain, ``(n, pieces)``.
        joints: Losses of the joints.
    """
    search = _JointSearch(space, losses, joints)
    current = best
    for joint in search.joints_with_faults(best):
        current = search.replaced(current, joint)
    while len(current) < max_faults:
        worst = search.worst_joint(current)
        added = current if worst is None else search.added(current, worst)
        if added == current:
            break
        current = added
    return current


class _JointSearch:
    """Choice of the fault of one joint."""

    def __init__(self, space: HypothesisSpace, losses: Losses, joints: JointLosses) -> None:
        self._space, self._losses, self._joints = space, losses, joints

    def joints_with_faults(self, hypothesis: Hypothesis) -> list[str]:
        parts = {fault.part for fault in hypothesis.faults}
        return [joint.name for joint in self._space.anatomy.joints if joint.name in parts]

    def worst_joint(self, hypothesis: Hypothesis) -> str | None:
        """The joint with the largest excess, if it is large and the joint has no fault."""
        joint, excess = next(iter(self._joints.excess(hypothesis).items()), ("", 0.0))
        is_new = joint not in self.joints_with_faults(hypothesis)
        return joint if excess >= MIN_EXCESS and is_new else None

    def replaced(self, current: Hypothesis, joint: str) -> Hypothesis:
        """The hypothesis with the best fault of a joint in the place of its present ones."""
        candidate = self._best_at(current, joint)
        return candidate if self._is_better_at(joint, candidate, current) else current

    def added(self, current: Hypothesis, joint: str) -> Hypothesis:
        """The hypothesis with the best fault of a joint, if it explains the joint."""
        candidate = self._best_at(current, joint)
        faults = [fault for fault in candidate.faults if fault.part == joint]
        if not faults or not self._is_better_at(joint, candidate, current):
            return current
        damaged = self._joints.of(joint, [candidate, current])
        healthy = self._joints.healthy_of(joint, [self._space.canonical(faults), INTACT])
        is_gain = gain_exceeds_healthy_gain(*known(damaged), *known(healthy))
        left = self._joints.excess(candidate).get(joint, 0.0)
        return candidate if is_gain and left < MIN_Z_OF_JOINT else current

    def _best_at(self, current: Hypothesis, joint: str) -> Hypothesis:
        """The hypothesis with the best fault of a joint; ``current`` if no fault is comparable."""
        others = [fault for fault in current.faults if fault.part != joint]
        by_kind: dict[str, list[Hypothesis]] = {}
        for fault in self._space.coarse_candidates:
            hypothesis = self._space.canonical([*others, fault])
            if fault.part == joint and len(hypothesis) > len(others):
                by_kind.setdefault(fault.kind.name, []).append(hypothesis)
        coarse = [self._smallest(levels, joint) for levels in by_kind.values()]
        few = sorted(coarse, key=lambda one: self._focused([one], joint)[0].sum())[:KINDS_FITTED]
        fitted = [self._fitted(one, joint) for one in few]
        return self._smallest([*fitted, current], joint) if fitted else current

    def _fitted(self, hypothesis: Hypothesis, joint: str) -> Hypothesis:
        """The hypothesis with the severity of the joint's fault fitted."""
        index = next(i for i, fault in enumerate(hypothesis.faults) if fault.part == joint)

        def focused(hypotheses: Sequence[Hypothesis]) -> FloatArray:
            return self._focused(hypotheses, joint)

        return with_fitted_severity(hypothesis, index, focused, self._space)

    def _smallest(self, hypotheses: Sequence[Hypothesis], joint: str) -> Hypothesis:
        return hypotheses[int(np.argmin(self._focused(hypotheses, joint).sum(axis=1)))]

    def _focused(self, hypotheses: Sequence[Hypothesis], joint: str) -> FloatArray:
        """Total losses plus those of the joint, ``(n, pieces)``; inf without evidence on it."""
        own = self._joints.of(joint, hypotheses)
        unknown = np.isnan(own)
        own = np.where(unknown.all(axis=1, keepdims=True), np.inf, np.where(unknown, 0.0, own))
        return self._losses(hypotheses) + own

    def _is_better_at(self, joint: str, one: Hypothesis, other: Hypothesis) -> bool:
        """Returns whether one predicts the joint better, and the trials not worse."""
        if one == other or is_better(*self._losses([other, one])):
            return False
        return joint_is_better(*self._joints.of(joint, [one, other]))
