"""Fit of the best hypothesis: the numbers behind a verdict."""

import math
from dataclasses import dataclass
from typing import Any


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
    """

    loss: float
    intact_loss: float
    healthy_loss: float | None
    excess: float | None
    threshold: float

    @property
    def left(self) -> float | None:
        """Share of the loss of the empty hypothesis beyond the reference that is left, 0 to 1."""
        if self.healthy_loss is None or not self.intact_loss > self.healthy_loss:
            return None
        share = (self.loss - self.healthy_loss) / (self.intact_loss - self.healthy_loss)
        return min(max(share, 0.0), 1.0)

    @property
    def is_unexplained(self) -> bool:
        """Whether the loss is significantly higher than that of healthy trials."""
        return self.excess is not None and self.excess > self.threshold

    def to_dict(self) -> dict[str, Any]:
        """Returns the JSON values; an infinite number is None."""
        return {
            "loss": _finite(self.loss),
            "intact_loss": _finite(self.intact_loss),
            "healthy_loss": _finite(self.healthy_loss),
            "excess": _finite(self.excess),
            "threshold": self.threshold,
            "left": _finite(self.left),
        }


def _finite(value: float | None) -> float | None:
    return value if value is None or math.isfinite(value) else None
