"""Events of a recovery or a diagnosis, reported to a callback as they happen."""

from dataclasses import dataclass

from selfmodel.diagnosis.choice import ChosenComparator
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.evolution import Generation
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.simulation.calibration import Calibration
from selfmodel.trials.trial import Trial


@dataclass(frozen=True)
class SearchBegins:
    """Start of a search.

    Attributes:
        kind: Name of the EA: ``repair`` or ``diagnostic``.
        hypothesis: Hypothesis that a repair compensates; None for a diagnosis.
    """

    kind: str
    hypothesis: Hypothesis | None = None


@dataclass(frozen=True)
class DiscriminatingTrial:
    """Start of a search for the controller whose trial separates hypotheses.

    Attributes:
        hypotheses: Hypotheses to separate, best first.
    """

    hypotheses: tuple[Hypothesis, ...]


Event = (
    SearchBegins
    | Generation
    | ChosenComparator
    | Calibration
    | DiscriminatingTrial
    | Trial
    | Diagnosis
)
"""Start or generation of a search, chosen comparator, calibration, start of the choice of a
discriminating trial, finished trial, or diagnosis."""
