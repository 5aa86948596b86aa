"""What happens in a recovery or a diagnosis, told as it happens."""

from dataclasses import dataclass

from selfmodel.diagnosis import Diagnosis
from selfmodel.evolution import Generation
from selfmodel.hypothesis import Hypothesis
from selfmodel.trial import Trial


@dataclass(frozen=True)
class SearchBegins:
    """A search begins.

    Attributes:
        kind: Which of the two EAs.
        hypothesis: What a repair takes to be wrong; None for a diagnosis.
    """

    kind: str
    hypothesis: Hypothesis | None = None


@dataclass(frozen=True)
class Calibrated:
    """The self-model was fitted to trials of the intact robot.

    Attributes:
        error_before: How badly it predicted them, in units of ``calibrate.SCALES``.
        error: How badly it predicts them now.
        delay: Control steps from a command to its effect.
    """

    error_before: float
    error: float
    delay: int


Event = SearchBegins | Generation | Calibrated | Trial | Diagnosis
"""Of a search that goes on, of a calibration, a trial that ended, a diagnosis that was made."""
