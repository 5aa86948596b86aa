"""A diagnosis as a row: whether it is right, and what it cost."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from time import perf_counter

from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.evolution import Generation
from selfmodel.experiments.ablation.rows import Row
from selfmodel.experiments.ablation.trials import Setting
from selfmodel.experiments.scoring import is_correct
from selfmodel.recovery.events import Event, SearchBegins
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Trial


@dataclass(eq=False)
class Clock:
    """Counts what diagnoses cost, and nothing between them.

    Attributes:
        evaluations: Hypotheses that the EA asked about.
        seconds: Wall time.
    """

    evaluations: int = 0
    seconds: float = 0.0
    _start: float = field(default_factory=perf_counter)
    _diagnosing: bool = False

    def __call__(self, event: Event) -> None:
        """Takes note of an event as it happens."""
        match event:
            case SearchBegins(kind):
                self._diagnosing = kind == "diagnostic"
                self._start = perf_counter()
            case Generation() if self._diagnosing and event.number == event.total:
                self.evaluations += event.evaluations
            case Diagnosis():
                self.seconds += perf_counter() - self._start


def row_of(setting: Setting, diagnosis: Diagnosis, trials: Sequence[Trial], clock: Clock) -> Row:
    """Returns the row of a diagnosis, but for what only the one who made it knows.

    Args:
        setting: The run.
        diagnosis: Of all trials so far.
        trials: These trials.
        clock: What the diagnoses of the run have cost so far.
    """
    cell = setting.spec.cell
    best = diagnosis.ranked[0]
    # A simulator of its own: judging is no part of what the diagnosis cost.
    judge = Simulator(setting.robot, threads=1)
    return Row(
        robot=cell.robot,
        case=cell.case,
        truth=str(setting.truth),
        gap=cell.gap,
        seed=cell.seed,
        next_trial=setting.spec.next_trial,
        comparator=setting.name,
        trials=diagnosis.trials,
        best=str(best.hypothesis),
        correct=is_correct(best.hypothesis, setting.truth, trials, judge),
        distance=_finite(best.distance),
        intact_distance=_finite(diagnosis.intact_distance),
        verdict=diagnosis.verdict,
        rivals=len(diagnosis.indistinguishable),
        evaluations=clock.evaluations,
        distinct_hypotheses=None,
        seconds=clock.seconds,
        before=None,
        after=None,
        recovered=None,
    )


def _finite(distance: float) -> float | None:
    return float(distance) if math.isfinite(distance) else None
