"""One run: physical trials, logged once, and what one comparator makes of them."""

import dataclasses
import shutil
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from urllib.parse import quote

from selfmodel.controllers.controller import Controller
from selfmodel.diagnosis.diagnose import DiagnosticSearch
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.experiments import plugins, robots
from selfmodel.experiments.ablation import bank
from selfmodel.experiments.ablation.plan import Spec
from selfmodel.experiments.ablation.rows import Row
from selfmodel.experiments.ablation.score_one import Clock, row_of
from selfmodel.experiments.ablation.trials import (
    Setting,
    after_failure,
    before_failure,
    calibrated_robot,
)
from selfmodel.experiments.experiment import Experiment, run
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.recovery.events import Event
from selfmodel.recovery.explain import diagnose_trials
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Trial


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
    bank_gaits = (
        bank.gait(gaits, spec.cell.robot, number) for number in spec.cell.gaits(spec.settings)
    )
    setting = setting_of(spec, comparator, folder, tuple(bank_gaits))
    return _WAYS[spec.next_trial](setting)


def setting_of(
    spec: Spec, comparator: str, folder: Path, gaits: tuple[Controller, ...] = ()
) -> Setting:
    """Returns the objects that a run's specification stands for.

    Args:
        spec: What to run.
        comparator: A name, or ``package.module:object``.
        folder: Where the run is kept.
        gaits: Its gaits, where trials are still to be run.
    """
    robot = robots.robot_entry(spec.cell.robot).robot()
    return Setting(
        spec=spec,
        comparator=plugins.comparator(comparator),
        name=comparator,
        robot=robot,
        truth=HypothesisSpace(robot.anatomy, plugins.kinds(spec.kinds)).parse(spec.cell.truth),
        gaits=gaits,
        folder=folder,
    )


def diagnosed(
    setting: Setting, robot: Robot, intact: Sequence[Trial], trials: Sequence[Trial]
) -> list[Row]:
    """Returns a row for the diagnosis after the first trial, and one for that after the last.

    Args:
        setting: The run.
        robot: The self-model, calibrated.
        intact: Trials before the failure.
        trials: Trials after it, at least one.

    Raises:
        InputError: The comparator cannot judge the trials.
    """
    search = DiagnosticSearch(
        Simulator(robot, threads=1),
        setting.comparator,
        setting.spec.settings,
        plugins.kinds(setting.spec.kinds),
        intact=intact,
    )
    rows: list[Row] = []
    clock = Clock()

    def on_event(event: Event) -> None:
        clock(event)
        if isinstance(event, Diagnosis):
            rows.append(
                dataclasses.replace(
                    row_of(setting, event, trials[: event.trials], clock),
                    evaluations=search.evaluations,
                    distinct_hypotheses=search.distinct_hypotheses,
                )
            )

    diagnose_trials(trials, search, setting.spec.cell.seed, on_event, after={1, len(trials)})
    return rows


def _from_the_bank(setting: Setting) -> list[Row]:
    """The trials are the same for every comparator, and so are their logs."""
    intact = before_failure(setting)
    trials = [
        after_failure(setting, number, gait)
        for number, gait in enumerate(setting.gaits[: setting.spec.settings.trials])
    ]
    return diagnosed(setting, calibrated_robot(setting, intact), intact, trials)


def _in_a_recovery(setting: Setting) -> list[Row]:
    """After the first, every comparator has trials of its own: what its diagnosis led to."""
    folder = setting.folder / quote(setting.name, safe="")
    shutil.rmtree(folder, ignore_errors=True)  # what is left of a run that was killed
    settings, cell = setting.spec.settings, setting.spec.cell
    rows: list[Row] = []
    trials: list[Trial] = []
    clock = Clock()

    def on_event(event: Event) -> None:
        clock(event)
        if isinstance(event, Trial):
            trials.append(event)
        elif isinstance(event, Diagnosis):
            ways = [trial.displacement for trial in trials]
            rows.append(
                dataclasses.replace(
                    row_of(setting, event, trials[1:], clock),
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
        kinds=plugins.kinds(setting.spec.kinds),
        next_trial=setting.spec.next_trial,
    )
    outcome = run(experiment, on_event)
    rows[-1] = dataclasses.replace(
        rows[-1], distinct_hypotheses=outcome.recovery.distinct_hypotheses
    )
    return rows


_WAYS: Mapping[str, Callable[[Setting], list[Row]]] = {
    "bank": _from_the_bank,
    "repair": _in_a_recovery,
    "disagreement": _in_a_recovery,
}
