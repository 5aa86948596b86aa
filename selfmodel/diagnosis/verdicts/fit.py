"""Fit of the best hypothesis: the numbers behind a verdict."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from selfmodel.diagnosis.verdicts.significance import LOSS_FLOOR, LOSS_RATIO

FAULTY_RATIO = 2.5
"""Loss of a hypothesis with faults over that of healthy trials that is much."""


@dataclass(frozen=True)
class Fit:
    """How well the best hypothesis predicts the trials, in the loss of the comparator.

    Attributes:
        loss: Mean loss of the best hypothesis on a piece of the trials.
        intact_loss: Mean loss of the empty hypothesis on the same pieces.
        healthy_loss: Mean loss of the empty hypothesis on healthy trials, the reference; None
            without healthy trials.
        excess: Excess of ``loss`` over ``healthy_loss``, standard errors; None without healthy
            trials.
        threshold: Excess above which the verdict is ``unexplained``, standard errors.
        has_faults: Whether the best hypothesis has faults.
        joints: Excess of the loss of single joints over that on healthy trials with the same gait,
            standard errors, by the joint's name, largest first: those of at least
            ``MIN_Z_OF_JOINT``, and none if the best hypothesis has faults.
    """

    loss: float
    intact_loss: float
    healthy_loss: float | None
    excess: float | None
    threshold: float
    has_faults: bool
    joints: Mapping[str, float] = field(default_factory=dict)

    @property
    def left(self) -> float | None:
        """Share of the loss of the empty hypothesis beyond the reference that is left, 0 to 1."""
        if self.healthy_loss is None or not self.intact_loss > self.healthy_loss:
            return None
        share = (self.loss - self.healthy_loss) / (self.intact_loss - self.healthy_loss)
        return min(max(share, 0.0), 1.0)

    @property
    def is_unexplained(self) -> bool:
        """Whether the loss is higher than that of healthy trials, significantly and by much.

        Faults make a motion harder to predict: a slipping foot, a body on the ground. So the loss
        of a hypothesis with faults has to exceed the reference by the factor ``FAULTY_RATIO`` too.
        A robot with a joint that does not move as in healthy trials is not intact.
        """
        if self.healthy_loss is None or self.excess is None:
            return False
        ratio = self.loss > LOSS_RATIO * self.healthy_loss + LOSS_FLOOR
        if self.has_faults:
            by_much = self.loss > FAULTY_RATIO * self.healthy_loss + LOSS_FLOOR
            return ratio or (by_much and self.excess > self.threshold)
        return ratio or self.excess > self.threshold or bool(self.joints)

    def to_dict(self) -> dict[str, Any]:
        """Returns the JSON values; an infinite number is None."""
        return {
            "loss": _finite(self.loss),
            "intact_loss": _finite(self.intact_loss),
            "healthy_loss": _finite(self.healthy_loss),
            "excess": _finite(self.excess),
            "threshold": self.threshold,
            "has_faults": self.has_faults,
            "left": _finite(self.left),
            "joints": {name: _finite(excess) for name, excess in self.joints.items()},
        }


def _finite(value: float | None) -> float | None:
    return value if value is None or math.isfinite(value) else None
