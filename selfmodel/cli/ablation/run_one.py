"""One run: physical trials, logged once, and what one comparator makes of them."""

import dataclasses
import math
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from urllib.parse import quote

from selfmodel.cli import resolve
from selfmodel.cli.ablation import bank
from selfmodel.cli.ablation.plan import Spec
from selfmodel.cli.ablation.rows import Row
from selfmodel.cli.ablation.trials import Setting, calibrated_robot, physical_trials
from selfmodel.cli.experiment import Experiment, run
from selfmodel.diagnose import Diagnose
from selfmodel.diagnosis import Diagnosis
from selfmodel.events import Event, SearchBegins
from selfmodel.evolution import Generation
from selfmodel.explain import explain
from selfmodel.judge import is_correct
from selfmodel.notation import parse
from selfmodel.simulator import Simulator
from selfmodel.trial import Trial


def run_one(spec: Spec, comparator: str, folder: Path, gaits: Path) -> list[Row]:
    """Returns a row for each diagnosis: after the first trial and the last, or after each repair.

    Args:
        spec: What to run.
        comparator: A name, or ``package.module:object``.
        folder: Where the run is kept; trials that are in it are not run again.
        gaits: The bank.

    Raises:
        InputError: The comparator cannot judge the trials.
        WorkError: A trial could not be run or read.
    """
    robot = resolve.robot_entry(spec.cell.robot).robot()
    setting = Setting(
        spec=spec,
        comparator=resolve.comparator(comparator),
        name=comparator,
        robot=robot,
        truth=parse(spec.cell.truth, robot.anatomy),
        gaits=tuple(
            bank.gait(gaits, spec.cell.robot, number) for number in spec.cell.gaits(spec.settings)
        ),
        folder=folder,
    )
    return _WAYS[spec.next_trial](setting)


def _from_the_bank(setting: Setting) -> list[Row]:
    """The trials are the same for every comparator, and so are their logs."""
    intact, trials = physical_trials(setting)
    simulator = Simulator(calibrated_robot(setting, intact), threads=1)
    search = Diagnose(
        simulator,
        setting.comparator,
        setting.spec.settings,
        resolve.kinds(setting.spec.kinds),
        intact=intact,
    )
    rows: list[Row] = []
    clock = _Clock()

    def watch(event: Event) -> None:
        clock(event)
        if isinstance(event, Diagnosis):
            rows.append(
                dataclasses.replace(
                    _row(setting, event, trials[: event.trials], clock),
                    evaluations=search.evaluations,
                    distinct_hypotheses=search.distinct_hypotheses,
                )
            )

    explain(trials, search, setting.spec.cell.seed, watch, after={1, len(trials)})
    return rows


def _by_repair(setting: Setting) -> list[Row]:
    """After the first, every comparator has trials of its own: what its diagnosis led to."""
    folder = setting.folder / quote(setting.name, safe="")
    shutil.rmtree(folder, ignore_errors=True)  # what is left of a run that was killed
    settings, cell = setting.spec.settings, setting.spec.cell
    rows: list[Row] = []
    trials: list[Trial] = []
    clock = _Clock()

    def watch(event: Event) -> None:
        clock(event)
        if isinstance(event, Trial):
            trials.append(event)
        elif isinstance(event, Diagnosis):
            ways = [trial.displacement for trial in trials]
            rows.append(
                dataclasses.replace(
                    _row(setting, event, trials[1:], clock),
                    before=ways[0],
                    after=ways[1],
                    recovered=max(ways[2:], default=None),
                )
            )

    experiment = Experiment(
        robot=setting.robot,
        case=cell.case,
        truth=setting.truth,
        comparator=setting.comparator,
        # The failing trial is the first of them.
        settings=dataclasses.replace(settings, trials=settings.trials - 1),
        seed=cell.seed,
        threads=1,
        folder=folder,
        gait=setting.gaits[0],
        gap=cell.gap,
        structure=setting.spec.structure,
        kinds=resolve.kinds(setting.spec.kinds),
    )
    outcome = run(experiment, watch)
    rows[-1] = dataclasses.replace(
        rows[-1], distinct_hypotheses=outcome.recovery.distinct_hypotheses
    )
    return rows


_WAYS: Mapping[str, Callable[[Setting], list[Row]]] = {
    "bank": _from_the_bank,
    "repair": _by_repair,
}


@dataclass(eq=False)
class _Clock:
    """Counts what diagnoses cost, and nothing between them."""

    evaluations: int = 0
    seconds: float = 0.0
    _start: float = field(default_factory=perf_counter)
    _diagnosing: bool = False

    def __call__(self, event: Event) -> None:
        match event:
            case SearchBegins(kind):
                self._diagnosing = kind == "diagnostic"
                self._start = perf_counter()
            case Generation() if self._diagnosing and event.number == event.total:
                self.evaluations += event.evaluations
            case Diagnosis():
                self.seconds += perf_counter() - self._start


def _row(setting: Setting, diagnosis: Diagnosis, trials: list[Trial], clock: _Clock) -> Row:
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
        rivals=len(diagnosis.rivals),
        evaluations=clock.evaluations,
        distinct_hypotheses=None,
        seconds=clock.seconds,
        before=None,
        after=None,
        recovered=None,
    )


def _finite(distance: float) -> float | None:
    return float(distance) if math.isfinite(distance) else None
