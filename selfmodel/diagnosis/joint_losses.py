"""Losses of single joints: the evidence on a fault of a joint in the motion of that joint."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.diagnosis.verdicts.change_point import MIN_PIECES
from selfmodel.diagnosis.verdicts.significance import MIN_Z, excess_over_healthy, paired_z
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.robot.anatomy import Anatomy

HingeLosses = Callable[[Sequence[Hypothesis]], FloatArray]
"""Returns the losses of each hinge, ``(n, pieces, hinges)``; NaN without evidence on the hinge."""


@dataclass(frozen=True, eq=False)
class JointLosses:
    """Losses of the motion of single joints.

    Attributes:
        anatomy: The robot's parts.
        damaged: Losses of each hinge on the trials to explain.
        healthy: Losses of each hinge on trials of the healthy robot; None if there are none.
    """

    anatomy: Anatomy
    damaged: HingeLosses
    healthy: HingeLosses | None

    def of(self, joint: str, hypotheses: Sequence[Hypothesis]) -> FloatArray:
        """Returns the losses of a joint on the trials to explain, ``(n, pieces)``.

        A loss is NaN where it is unknown.
        """
        return self._of_joint(joint, self.damaged(hypotheses))

    def healthy_of(self, joint: str, hypotheses: Sequence[Hypothesis]) -> FloatArray:
        """Returns the losses of a joint on healthy trials, ``(n, pieces)``.

        Without healthy trials there are no pieces.
        """
        if self.healthy is None:
            return np.empty((len(hypotheses), 0))
        return self._of_joint(joint, self.healthy(hypotheses))

    def excess(self, hypothesis: Hypothesis) -> dict[str, float]:
        """Returns the excess of each joint's loss over that on healthy trials, largest first.

        Args:
            hypothesis: Hypothesis about the trials to explain; on the healthy trials, the empty
                one is compared.

        Returns:
            Excess by the joint's name, standard errors, of the joints with at least ``MIN_PIECES``
            known pieces in either; see ``significance.excess_over_healthy``.
        """
        if self.healthy is None:
            return {}
        damaged, healthy = self.damaged([hypothesis]), self.healthy([INTACT])
        found = {}
        for joint in self.anatomy.joints:
            one, other = (known(self._of_joint(joint.name, rows))[0] for rows in (damaged, healthy))
            if min(len(one), len(other)) >= MIN_PIECES:
                found[joint.name] = excess_over_healthy(one, other)
        return dict(sorted(found.items(), key=lambda item: -item[1]))

    def distinguishes(self, better: Hypothesis, others: Sequence[Hypothesis]) -> BoolArray:
        """Returns a mask of the hypotheses that predict some joint significantly worse, ``(n,)``.

        Args:
            better: The hypothesis that may be better.
            others: Hypotheses; the joints at which their faults differ are compared.
        """
        if not others:
            return np.zeros(0, dtype=np.bool_)
        best, *rows = self.damaged([better, *others])
        return np.array(
            [
                any(
                    joint_is_better(*self._of_joint(joint, np.stack([best, row])))
                    for joint in self._different(better, other)
                )
                for other, row in zip(others, rows, strict=True)
            ]
        )

    def _different(self, one: Hypothesis, other: Hypothesis) -> list[str]:
        """Returns the joints at which exactly one of two hypotheses has a fault."""
        different = set(one.faults) ^ set(other.faults)
        parts = {fault.part for fault in different if fault.kind.is_of_joint}
        return [joint.name for joint in self.anatomy.joints if joint.name in parts]

    def _of_joint(self, joint: str, losses: FloatArray) -> FloatArray:
        """Returns the mean over a joint's known hinges, ``(n, pieces)``; NaN without any."""
        columns = [self.anatomy.hinges.index(hinge) for hinge in self.anatomy.joint(joint).hinges]
        some = losses[:, :, columns]
        is_known = ~np.isnan(some)
        count = is_known.sum(axis=2)
        total = np.where(is_known, some, 0.0).sum(axis=2)
        return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def known(rows: FloatArray) -> FloatArray:
    """Returns the pieces that are known in every row, ``(n, known pieces)``."""
    return np.asarray(rows[:, ~np.isnan(rows).any(axis=0)])


def joint_is_better(one: FloatArray, other: FloatArray) -> bool:
    """Returns whether the losses of a joint are significantly smaller.

    Args:
        one: Losses of a hypothesis, ``(pieces,)``; NaN if unknown.
        other: Losses of another hypothesis on the same pieces.

    Returns:
        False with fewer than ``MIN_PIECES`` pieces that are known in both.
    """
    smaller, larger = known(np.stack([one, other]))
    if len(smaller) < MIN_PIECES or not np.isfinite(smaller).all():
        return False
    return not np.isfinite(larger).all() or paired_z(larger, smaller) >= MIN_Z
