"""Row of a diagnosis: its correctness and its cost."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from time import perf_counter

from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.evolution import Generation
from selfmodel.experiments.ablation.rows import AblationRow
from selfmodel.experiments.ablation.trials import Setting
from selfmodel.recovery.events import Event, SearchBegins
from selfmodel.simulation.simulator import Simulator
from selfmodel.studies.experiment import is_correct
from selfmodel.trials.trial import Trial


@dataclass(eq=False)
class DiagnosisCost:
    """Callback that accumulates the cost of diagnoses, without the time between them.

    Attributes:
        evaluations: Number of hypotheses evaluated by the diagnostic EA.
        seconds: Wall time of the diagnoses, s.
    """

    evaluations: int = 0
    seconds: float = 0.0
    _start: float = field(default_factory=perf_counter)
    _diagnosing: bool = False

    def __call__(self, event: Event) -> None:
        """Adds the cost of an event."""
        match event:
            case SearchBegins(kind):
                self._diagnosing = kind == "diagnostic"
                self._start = perf_counter()
            case Generation() if self._diagnosing and event.number == event.total:
                self.evaluations += event.evaluations
            case Diagnosis():
                self.seconds += perf_counter() - self._start


def row_of(
    setting: Setting,
    comparator: str,
    diagnosis: Diagnosis,
    trials: Sequence[Trial],
    cost: DiagnosisCost,
) -> AblationRow:
    """Returns the row of a diagnosis, without displacements and number of distinct hypotheses.

    Args:
        setting: The run.
        comparator: Name of the comparator.
        diagnosis: Diagnosis of all trials so far.
        trials: Trials of the damaged robot so far.
        cost: Cost of the diagnoses of the run so far.
    """
    best = diagnosis.ranked[0]
    # A separate simulator: scoring does not count as cost of the diagnosis.
    simulator = Simulator(setting.robot, threads=1)
    return AblationRow(
        robot=setting.name,
        case=setting.case,
        truth=str(setting.truth),
        gap=setting.gap,
        seed=setting.seed,
        next_trial=setting.shared["next_trial"],
        comparator=comparator,
        trials=diagnosis.trials,
        best=str(best.hypothesis),
        correct=is_correct(best.hypothesis, setting.truth, trials, simulator),
        distance=_finite(best.distance),
        intact_distance=_finite(diagnosis.intact_distance),
        verdict=diagnosis.verdict,
        rivals=len(diagnosis.indistinguishable),
        evaluations=cost.evaluations,
        distinct_hypotheses=None,
        seconds=cost.seconds,
        before=None,
        after=None,
        recovered=None,
        repair=setting.shared["repair"] if setting.evolves else None,
        search=setting.shared["search"] if setting.evolves else None,
    )


def _finite(distance: float) -> float | None:
    return float(distance) if math.isfinite(distance) else None
