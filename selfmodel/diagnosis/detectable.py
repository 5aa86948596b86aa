"""Smallest detectable weakness of each motor: the limit of what the trials show."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.diagnosis.loss_functions import Losses
from selfmodel.diagnosis.significance import (
    LOSS_RATIO,
    MIN_Z_ACROSS_TRIALS,
    NEGLIGIBLE_LOSS,
    paired_z,
)
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.kind import Fault
from selfmodel.faults.motor import WEAK_MOTOR

TORQUES = (0.95, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 0.0)
"""Remaining torques that are tested, as fractions, largest first."""


@dataclass(frozen=True)
class DetectableWeakness:
    """The smallest weakness of the motors of a joint that the trials would have shown.

    Attributes:
        joint: Name of the joint.
        torque: The largest remaining fraction of the torque that predicts the trials clearly
            worse than the best hypothesis, as every smaller one does; None if a motor without
            torque would not have shown.
    """

    joint: str
    torque: float | None

    def to_dict(self) -> dict[str, Any]:
        """Returns the JSON values."""
        return {"joint": self.joint, "torque": self.torque}


def detectable_weaknesses(
    best: Hypothesis, space: HypothesisSpace, losses: Losses
) -> list[DetectableWeakness]:
    """Returns the smallest detectable weakness of every joint with motors.

    Joints with a fault in the best hypothesis are left out.

    Args:
        best: The best hypothesis.
        space: The hypotheses about the robot.
        losses: Losses of hypotheses on the trials, ``(n, segments)``.

    Returns:
        In the order of the joints; empty if the space does not contain weak motors.
    """
    if WEAK_MOTOR not in space.kinds:
        return []
    faulty = {fault.part for fault in best.faults}
    joints = [joint for joint in WEAK_MOTOR.parts(space.anatomy) if joint not in faulty]
    weaker = {
        joint: [space.canonical([*best.faults, Fault(WEAK_MOTOR, joint, t)]) for t in TORQUES]
        for joint in joints
    }
    best_losses, *rows = losses([best, *(one for ones in weaker.values() for one in ones)])
    shown = [_is_clearly_worse(row, best_losses) for row in rows]
    return [
        DetectableWeakness(joint, _largest(shown[i * len(TORQUES) : (i + 1) * len(TORQUES)]))
        for i, joint in enumerate(joints)
    ]


def _is_clearly_worse(one: FloatArray, best: FloatArray) -> bool:
    """Returns whether a fault would have been found: worse by more than a diagnosis requires.

    A fault is found if it is better than the empty hypothesis by ``significance.MIN_Z`` standard
    errors. The losses of a trial with the fault are not known, so the margin is larger. On the log
    of a real robot, weaknesses with ``MIN_Z`` were found in half of the cases.
    """
    if not np.isfinite(best).all():
        return False
    if not np.isfinite(one).all():
        return True
    more = one.mean() > best.mean() + NEGLIGIBLE_LOSS
    ratio = one.mean() > LOSS_RATIO * best.mean() + NEGLIGIBLE_LOSS
    return bool(more and (ratio or paired_z(one, best) >= MIN_Z_ACROSS_TRIALS))


def _largest(shown: Sequence[bool]) -> float | None:
    """Returns the largest torque from which on all smaller ones are shown."""
    hidden = [i for i, each in enumerate(shown) if not each]
    first = hidden[-1] + 1 if hidden else 0
    return TORQUES[first] if first < len(TORQUES) else None
