"""One part of an ablation: the trials of a run, and their diagnosis by one comparator."""

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
from selfmodel.experiments.ablation.rows import AblationRow
from selfmodel.experiments.ablation.score_one import DiagnosisCost, row_of
from selfmodel.experiments.ablation.trials import (
    Setting,
    after_failure,
    before_failure,
    calibrated_robot,
)
from selfmodel.experiments.arguments import comparator_choice
from selfmodel.experiments.chosen_score import choose_score
from selfmodel.experiments.experiment import Experiment, run
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.recovery.events import Event
from selfmodel.recovery.sequential_diagnosis import diagnose_trials
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Trial


def run_one(spec: Spec, comparator: str, folder: Path, gaits: Path) -> list[AblationRow]:
    """Returns a row per diagnosis: after the first and the last trial, or after each trial.

    Args:
        spec: Specification of the run.
        comparator: Name of a comparator, or ``package.module:object``.
        folder: Folder of the run; its trials are not run again.
        gaits: Folder of the bank.

    Raises:
        InputError: The comparator cannot compare the trials.
        WorkError: A trial could not be run or read.
    """
    bank_gaits = (
        bank.gait(gaits, spec.cell.robot, number) for number in spec.cell.gaits(spec.settings)
    )
    setting = setting_of(spec, comparator, folder, tuple(bank_gaits))
    return _TRIAL_CHOICES[spec.next_trial](setting)


def files_of(spec: Spec, comparator: str, folder: Path) -> list[Path]:
    """Returns the files that a finished part of a run has read: trial logs and self-model.

    Args:
        spec: Specification of the run.
        comparator: Name of the comparator.
        folder: Folder of the run.
    """
    if spec.next_trial == "bank":
        return [*sorted((folder / "trials").glob("*.mcap")), folder / "calibrated.xml"]
    return sorted((_own_folder(folder, comparator) / "trials").glob("*.mcap"))


def setting_of(
    spec: Spec, comparator: str, folder: Path, gaits: tuple[Controller, ...] = ()
) -> Setting:
    """Returns the objects of a run's specification.

    Args:
        spec: Specification of the run.
        comparator: Name of a comparator, or ``package.module:object``.
        folder: Folder of the run.
        gaits: Gaits of the run; unused if all its trials are logged.
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


def diagnose_run(
    setting: Setting, robot: Robot, healthy: Sequence[Trial], trials: Sequence[Trial]
) -> list[AblationRow]:
    """Returns the rows of the diagnoses after the first and after the last trial.

    Args:
        setting: The run.
        robot: The calibrated self-model.
        healthy: Trials before the failure.
        trials: Trials after the failure, at least one.

    Raises:
        InputError: The comparator cannot compare the trials.
    """
    search = DiagnosticSearch(
        Simulator(robot, threads=1),
        setting.comparator,
        setting.spec.settings,
        plugins.kinds(setting.spec.kinds),
        intact=healthy,
    )
    rows: list[AblationRow] = []
    cost = DiagnosisCost()

    def on_event(event: Event) -> None:
        cost(event)
        if isinstance(event, Diagnosis):
            rows.append(
                dataclasses.replace(
                    row_of(setting, event, trials[: event.trials], cost),
                    evaluations=search.evaluations,
                    distinct_hypotheses=search.distinct_hypotheses,
                )
            )

    diagnose_trials(trials, search, setting.spec.cell.seed, on_event, after={1, len(trials)})
    return rows


def _from_the_bank(setting: Setting) -> list[AblationRow]:
    """Returns the rows of trials with gaits of the bank, whose logs all comparators share."""
    healthy = before_failure(setting)
    trials = [
        after_failure(setting, number, gait)
        for number, gait in enumerate(setting.gaits[: setting.spec.settings.trials])
    ]
    return diagnose_run(setting, calibrated_robot(setting, healthy), healthy, trials)


def _in_a_recovery(setting: Setting) -> list[AblationRow]:
    """Returns the rows of a recovery, whose later trials depend on the comparator."""
    folder = _own_folder(setting.folder, setting.name)
    shutil.rmtree(folder, ignore_errors=True)  # files of a killed run
    settings, cell = setting.spec.settings, setting.spec.cell
    rows: list[AblationRow] = []
    trials: list[Trial] = []
    cost = DiagnosisCost()
    score = choose_score(
        setting.spec.score,
        robots.robot_entry(cell.robot),
        network_for(setting.robot),
        steps=settings.steps,
        seed=cell.seed,
        gait=setting.gaits[0],
    ).score

    def on_event(event: Event) -> None:
        cost(event)
        if isinstance(event, Trial):
            trials.append(event)
        elif isinstance(event, Diagnosis):
            before, *since = (
                score.of_trial(setting.robot, setting.truth if number else INTACT, trial)
                for number, trial in enumerate(trials)
            )
            rows.append(
                dataclasses.replace(
                    row_of(setting, event, trials[1:], cost),
                    before=before,
                    after=since[0],
                    recovered=max(since[1:], default=None),
                )
            )

    experiment = Experiment(
        robot=setting.robot,
        case=cell.case,
        truth=setting.truth,
        choose_comparator=comparator_choice(setting.comparator),
        # The trials of an experiment exclude the failing trial.
        settings=dataclasses.replace(settings, trials=settings.trials - 1),
        seed=cell.seed,
        threads=1,
        folder=folder,
        gait=setting.gaits[0],
        gap=cell.gap,
        structure=setting.spec.structure,
        kinds=plugins.kinds(setting.spec.kinds),
        next_trial=setting.spec.next_trial,
        score=score,
    )
    outcome = run(experiment, on_event)
    rows[-1] = dataclasses.replace(
        rows[-1], distinct_hypotheses=outcome.recovery.distinct_hypotheses
    )
    return rows


def _own_folder(run: Path, comparator: str) -> Path:
    """Returns the folder of the recovery with a comparator, whose trials are its own."""
    return run / quote(comparator, safe="")


_TRIAL_CHOICES: Mapping[str, Callable[[Setting], list[AblationRow]]] = {
    "bank": _from_the_bank,
    "repair": _in_a_recovery,
    "disagreement": _in_a_recovery,
}
