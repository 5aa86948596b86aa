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
from selfmodel.diagnosis import significance
from selfmodel.diagnosis.problem import Problem
from selfmodel.diagnosis.search import LocalSearch, with_fitted_severity
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.kind import Fault
from selfmodel.progress import followed

STAGE = "faults of joints"
"""Name of this search in its progress."""

JOINTS_TRIED, KINDS_FITTED = 3, 3
"""Joints that are tried for an addition, and kinds whose severities are fitted, best first."""


def with_joint_faults(best: Hypothesis, search: LocalSearch) -> Hypothesis:
    """Returns the best hypothesis of a search, its faults of joints decided by the joints' motion.

    The problem of the search has losses of joints.
    """
    joints = _JointSearch(best, search)
    current = best
    faulty = joints_of(best.faults, search.problem)
    for joint in followed(faulty, STAGE, search.problem.observer):
        current = joints.replaced(current, joint)
    while len(current) < search.problem.settings.genes:
        added = joints.with_one_more(current)
        if added == current:
            break
        current = added
    return best if current == best else joints.pruned(current)


def excesses(hypothesis: Hypothesis, problem: Problem) -> dict[str, float]:
    """Returns the excess of each joint's loss over that of ``INTACT`` on healthy trials.

    It is in standard errors by the joint's name, largest first, of the joints with at least
    ``MIN_PIECES`` known pieces in either; see ``significance.excess_over_healthy``.
    """
    excess = {}
    for joint in problem.space.anatomy.joints:
        (one,) = significance.known(problem.of_joint(joint.name, [hypothesis]))
        (other,) = significance.known(problem.of_joint(joint.name, [INTACT], healthy=True))
        if min(len(one), len(other)) >= significance.MIN_PIECES:
            excess[joint.name] = significance.excess_over_healthy(one, other)
    return dict(sorted(excess.items(), key=lambda item: -item[1]))


def lead_at_joints(best: Hypothesis, other: Hypothesis, problem: Problem) -> float:
    """Returns by how many standard errors the best predicts some joint better than another does.

    The joints at which exactly one of the two has a fault are compared.
    """
    joints = joints_of(set(best.faults) ^ set(other.faults), problem)
    leads = (significance.joint_lead(*problem.of_joint(joint, [best, other])) for joint in joints)
    return max(leads, default=0.0)


def joints_of(faults: Sequence[Fault] | set[Fault], problem: Problem) -> list[str]:
    """Returns the joints with a fault of their motion, in the order of the anatomy."""
    parts = {fault.part for fault in faults if fault.kind.is_of_joint}
    return [joint.name for joint in problem.space.anatomy.joints if joint.name in parts]


class _JointSearch:
    """Choice of the faults of joints, beginning with a hypothesis."""

    def __init__(self, start: Hypothesis, search: LocalSearch) -> None:
        self._start, self._search, self._losses = start, search, search.losses
        self._problem, self._space = search.problem, search.problem.space

    def replaced(self, current: Hypothesis, joint: str) -> Hypothesis:
        """The hypothesis with the best fault of a joint in the place of its present ones."""
        levels = self._best_levels(current, joint)
        if not levels:
            return current
        candidate = self._best_fitted(levels, joint)
        if self._is_better_at(joint, candidate, current):
            return candidate
        is_enough = (
            len(candidate) < len(current)
            and not significance.joint_is_better(
                *self._problem.of_joint(joint, [current, candidate])
            )
            and not self._harms(candidate, current)
        )
        return candidate if is_enough else current

    def with_one_more(self, current: Hypothesis) -> Hypothesis:
        """The hypothesis with a fault of a further joint; the same if none explains its joint."""
        faulty = joints_of(current.faults, self._problem)
        excess = excesses(current, self._problem)
        suspects = [
            name
            for name, z in excess.items()
            if z >= significance.MIN_EXCESS_OF_JOINT and name not in faulty
        ]
        for joint in followed(suspects[:JOINTS_TRIED], STAGE, self._problem.observer):
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
        for fewer in self._space.with_one_less(hypothesis):
            removed = set(hypothesis.faults) - set(fewer.faults)
            if not significance.is_better(*self._losses([hypothesis, fewer])) and not any(
                significance.joint_is_better(*self._problem.of_joint(joint, [hypothesis, fewer]))
                for joint in joints_of(removed, self._problem)
            ):
                return self.pruned(fewer)
        return hypothesis

    def _explains(
        self, joint: str, candidate: Hypothesis, current: Hypothesis, excess: float
    ) -> bool:
        """Returns whether a fault of a joint is the cause of its excess, and no model error."""
        if not self._is_better_at(joint, candidate, current):
            return False
        alone = self._space.canonical(_faults_at(joint, candidate))
        damaged = significance.known(self._problem.of_joint(joint, [candidate, current]))
        healthy = significance.known(self._problem.of_joint(joint, [alone, INTACT], healthy=True))
        left = excesses(candidate, self._problem).get(joint, np.inf)
        is_cause = left < min(significance.MIN_Z_OF_JOINT, significance.MAX_LEFT_OF_JOINT * excess)
        return is_cause and significance.gain_exceeds_healthy_gain(*damaged, *healthy)

    def _best_levels(self, current: Hypothesis, joint: str) -> list[Hypothesis]:
        """The hypothesis with each kind of fault of a joint at its best level, best first.

        There is none without evidence on the joint, and none of a fault that is ``hopeless``.
        """
        if np.isnan(self._problem.of_joint(joint, [current])).all():
            return []
        others = [fault for fault in current.faults if fault not in _faults_at(joint, current)]
        there = [
            fault
            for fault in self._space.coarse_candidates
            if fault.kind.is_of_joint and fault.part == joint
        ]
        hopeless = self._search.hopeless([self._space.canonical([fault]) for fault in there])
        by_kind: dict[str, list[Hypothesis]] = {}
        for fault in there:
            if fault not in hopeless:
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
            (fault,) = _faults_at(joint, hypothesis)
            index = hypothesis.faults.index(fault)
            fitted.append(with_fitted_severity(hypothesis, index, focused, self._space))
        return self._smallest(fitted, joint)

    def _smallest(self, hypotheses: Sequence[Hypothesis], joint: str) -> Hypothesis:
        return hypotheses[int(np.argmin(self._focused(hypotheses, joint).sum(axis=1)))]

    def _focused(self, hypotheses: Sequence[Hypothesis], joint: str) -> FloatArray:
        """Total losses plus those of the joint, ``(n, pieces)``; inf without evidence on it."""
        losses = self._problem.of_joint(joint, hypotheses)
        unknown = np.isnan(losses)
        losses[unknown] = 0.0
        losses[unknown.all(axis=1)] = np.inf
        return self._losses(hypotheses) + losses

    def _is_better_at(self, joint: str, one: Hypothesis, other: Hypothesis) -> bool:
        """Returns whether one predicts the joint better, and the trials not worse."""
        is_better_there = significance.joint_is_better(*self._problem.of_joint(joint, [one, other]))
        return is_better_there and not self._harms(one, other)

    def _harms(self, one: Hypothesis, other: Hypothesis) -> bool:
        """Returns whether one predicts the trials worse than another, or than the start."""
        after, before, start = self._losses([one, other, self._start])
        return significance.is_better(before, after) or significance.is_better(start, after)


def _faults_at(joint: str, hypothesis: Hypothesis) -> list[Fault]:
    """Returns the faults of the motion of a joint."""
    return [fault for fault in hypothesis.faults if fault.kind.is_of_joint and fault.part == joint]
