"""What happens in a recovery or a diagnosis, told as it happens."""

from dataclasses import dataclass

from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.evolution import Generation
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.simulation.calibration import Calibration
from selfmodel.trials.trial import Trial


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
class Question:
    """The next trial is to tell hypotheses apart.

    Attributes:
        hypotheses: Those that are still in the running, the best first.
    """

    hypotheses: tuple[Hypothesis, ...]


Event = SearchBegins | Generation | Calibration | Question | Trial | Diagnosis
"""Of a search that goes on, of a calibration, of what the next trial is for, a trial that ended, a
diagnosis that was made."""
