"""Faults of single joints, decided by the motion of the joint itself.

The search before this one compares losses over all signals. A small fault of a joint is lost in
them, and so is the difference between kinds with similar effects: dry friction, damping, a weak
motor, a jam. The joint's own motion contains both. On 24 recordings of another generator with one
such fault (seed 0), the loss of the joint was 4 to 53 standard errors above that in the healthy
trial; in 16 recordings of healthy robots with the same gait, no joint's was above 2.1.

1. **Replacement**: at each joint with a fault, the best fault of the joint takes the place of the
   present one if the motion of the joint is predicted significantly better; in the place of
   several, if it is not predicted significantly worse.
2. **Addition**: of the joints with an excess over the healthy trials, largest first, the first
   whose best fault explains it gets this fault, until none does.
3. **Pruning**, after a replacement or addition: a fault that is no longer required is removed.

No step accepts a hypothesis that predicts the trials significantly worse. The best fault of a joint
has the smallest sum of the total loss and the joint's loss.
"""

from collections.abc import Sequence
from functools import partial

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
from selfmodel.faults.kind import Fault

MIN_EXCESS = 2.0
"""Standard errors by which the loss of a joint has to exceed that in healthy trials for a fault of
the joint to be searched. It is lower than ``MIN_Z_OF_JOINT``, because the gain of a fault is paired
over the pieces and so tested more sharply than the excess."""

MAX_LEFT = 0.5
"""Largest share of a joint's excess that an added fault may leave; one that leaves more is not the
cause."""

JOINTS_TRIED, KINDS_FITTED = 3, 3
"""Joints that are tried for an addition, and kinds whose severities are fitted, best first."""


def with_joint_faults(
    best: Hypothesis,
    space: HypothesisSpace,
    max_faults: int,
    losses: Losses,
    joints: JointLosses,
) -> Hypothesis:
    """Returns a hypothesis with its faults of single joints decided by the joints' own motion.

    An added fault has to gain significantly more than on healthy trials, and to explain the joint.

    Args:
        best: The best hypothesis by the total loss.
        space: The hypotheses about the robot.
        max_faults: Maximum number of faults of a hypothesis.
        losses: Losses of hypotheses on the trials to explain, ``(n, pieces)``.
        joints: Losses of the joints.
    """
    search = _JointSearch(best, space, losses, joints)
    current = best
    for joint in search.joints_of(best):
        current = search.replaced(current, joint)
    while len(current) < max_faults:
        added = search.with_one_more(current)
        if added == current:
            break
        current = added
    return best if current == best else search.pruned(current)


class _JointSearch:
    """Choice of the faults of joints, beginning with a hypothesis."""

    def __init__(
        self, start: Hypothesis, space: HypothesisSpace, losses: Losses, joints: JointLosses
    ) -> None:
        self._start, self._space, self._losses, self._joints = start, space, losses, joints

    def joints_of(self, hypothesis: Hypothesis) -> list[str]:
        """The joints with a fault of their motion, in the order of the anatomy."""
        parts = {fault.part for fault in hypothesis.faults if fault.kind.is_of_joint}
        return [joint.name for joint in self._space.anatomy.joints if joint.name in parts]

    def replaced(self, current: Hypothesis, joint: str) -> Hypothesis:
        """The hypothesis with the best fault of a joint in the place of its present ones."""
        levels = self._best_levels(current, joint)
        if not levels:
            return current
        candidate = self._best_fitted(levels, joint)
        if self._is_better_at(joint, candidate, current):
            return candidate
        is_simpler = len(candidate) < len(current)
        is_worse = joint_is_better(*self._joints.of(joint, [current, candidate]))
        is_enough = is_simpler and not is_worse and not self._harms(candidate, current)
        return candidate if is_enough else current

    def with_one_more(self, current: Hypothesis) -> Hypothesis:
        """The hypothesis with a fault of a further joint; the same if none explains its joint."""
        taken = self.joints_of(current)
        excess = self._joints.excess(current)
        suspects = [name for name, z in excess.items() if z >= MIN_EXCESS and name not in taken]
        for joint in suspects[:JOINTS_TRIED]:
            levels = self._best_levels(current, joint)
            # A level near the true severity is much better already: fits cost most of this search.
            if not levels or not self._is_better_at(joint, levels[0], current):
                continue
            candidate = self._best_fitted(levels, joint)
            if self._explains(joint, candidate, current, excess[joint]):
                return candidate
        return current

    def pruned(self, hypothesis: Hypothesis) -> Hypothesis:
        """The hypothesis without the faults that neither the trials nor their joints require."""
        current = hypothesis
        while True:
            fewer = next(
                (one for one in self._space.with_one_less(current) if self._suffices(one, current)),
                None,
            )
            if fewer is None:
                return current
            current = fewer

    def _suffices(self, fewer: Hypothesis, current: Hypothesis) -> bool:
        if is_better(*self._losses([current, fewer])):
            return False
        removed = set(current.faults) - set(fewer.faults)
        joints = [fault.part for fault in removed if fault.kind.is_of_joint]
        return not any(
            joint_is_better(*self._joints.of(joint, [current, fewer])) for joint in joints
        )

    def _explains(
        self, joint: str, candidate: Hypothesis, current: Hypothesis, excess: float
    ) -> bool:
        """Returns whether a fault of a joint is the cause of its excess, and no model error."""
        if not self._is_better_at(joint, candidate, current):
            return False
        alone = self._space.canonical(_faults_of(candidate, joint))
        damaged = known(self._joints.of(joint, [candidate, current]))
        healthy = known(self._joints.healthy_of(joint, [alone, INTACT]))
        left = self._joints.excess(candidate).get(joint, np.inf)
        is_cause = left < min(MIN_Z_OF_JOINT, MAX_LEFT * excess)
        return is_cause and gain_exceeds_healthy_gain(*damaged, *healthy)

    def _best_levels(self, current: Hypothesis, joint: str) -> list[Hypothesis]:
        """The hypothesis with each kind of fault of a joint at its best level, best first.

        There is none without evidence on the joint.
        """
        if np.isnan(self._joints.of(joint, [current])).all():
            return []
        others = [fault for fault in current.faults if fault not in _faults_of(current, joint)]
        by_kind: dict[str, list[Hypothesis]] = {}
        for fault in self._space.coarse_candidates:
            if fault.kind.is_of_joint and fault.part == joint:
                hypothesis = self._space.canonical([*others, fault])
                if len(hypothesis) > len(others):
                    by_kind.setdefault(fault.kind.name, []).append(hypothesis)
        best = [self._smallest(levels, joint) for levels in by_kind.values()]
        return sorted(best, key=lambda one: float(self._focused([one], joint)[0].sum()))

    def _best_fitted(self, levels: Sequence[Hypothesis], joint: str) -> Hypothesis:
        """The best of the first hypotheses, with the severity of the joint's fault fitted."""
        focused = partial(self._focused, joint=joint)
        fitted = []
        for hypothesis in levels[:KINDS_FITTED]:
            (fault,) = _faults_of(hypothesis, joint)
            index = hypothesis.faults.index(fault)
            fitted.append(with_fitted_severity(hypothesis, index, focused, self._space))
        return self._smallest(fitted, joint)

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
        is_better_there = joint_is_better(*self._joints.of(joint, [one, other]))
        return is_better_there and not self._harms(one, other)

    def _harms(self, one: Hypothesis, other: Hypothesis) -> bool:
        """Returns whether one predicts the trials worse than another, or than the start."""
        after, before, start = self._losses([one, other, self._start])
        return is_better(before, after) or is_better(start, after)


def _faults_of(hypothesis: Hypothesis, joint: str) -> list[Fault]:
    """Returns the faults of the motion of a joint."""
    return [fault for fault in hypothesis.faults if fault.kind.is_of_joint and fault.part == joint]
