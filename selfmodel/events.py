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


Event = SearchBegins | Generation | Trial | Diagnosis
"""Of a search that goes on, of a trial that ended, of a diagnosis that was made."""
