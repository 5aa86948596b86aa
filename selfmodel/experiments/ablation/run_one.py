"""Cells of an ablation: the diagnosis of a run's trials, or a recovery, with one comparator."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from selfmodel import plugins
from selfmodel.arguments import comparator_choice
from selfmodel.diagnosis.diagnose import DiagnosticSearch
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.experiments.ablation.rows import AblationRow
from selfmodel.experiments.ablation.score_one import DiagnosisCost, row_of
from selfmodel.experiments.ablation.trials import (
    Setting,
    calibrated_robot,
    read_trials,
    setting_of,
)
from selfmodel.experiments.grid import Cell
from selfmodel.experiments.study.files import as_dicts
from selfmodel.experiments.study.gaits import read_gait
from selfmodel.faults.hypothesis import INTACT
from selfmodel.recovery.events import Event
from selfmodel.recovery.recover import diagnose_trials
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.studies.experiment import Experiment, run
from selfmodel.studies.scores import choose_score
from selfmodel.trials.trial import Trial


def diagnose(cell: Cell, needs: Mapping[str, Path], _folder: Path) -> list[dict[str, Any]]:
    """Returns a row per diagnosis: after the first and after the last trial.

    Raises:
        InputError: The comparator cannot compare the trials.
    """
    setting = setting_of(cell)
    healthy, trials = read_trials(needs["trials"])
    robot = calibrated_robot(setting.robot, needs["trials"])
    return as_dicts(diagnose_run(setting, cell.part, robot, healthy, trials))


def diagnose_run(
    setting: Setting,
    comparator: str,
    robot: Robot,
    healthy: Sequence[Trial],
    trials: Sequence[Trial],
) -> list[AblationRow]:
    """Returns the rows of the diagnoses after the first and after the last trial.

    Args:
        setting: The run.
        comparator: Name of a comparator, or ``package.module:object``.
        robot: The calibrated self-model.
        healthy: Trials before the failure.
        trials: Trials after the failure, at least one.

    Raises:
        InputError: The comparator cannot compare the trials.
    """
    search = DiagnosticSearch(
        Simulator(robot, threads=1),
        plugins.comparator(comparator),
        setting.settings,
        plugins.kinds(setting.shared["kinds"]),
        healthy_trials=healthy,
    )
    rows: list[AblationRow] = []
    cost = DiagnosisCost()

    def on_event(event: Event) -> None:
        cost(event)
        if isinstance(event, Diagnosis):
            rows.append(
                dataclasses.replace(
                    row_of(setting, comparator, event, trials[: event.trials], cost),
                    evaluations=search.evaluations,
                    distinct_hypotheses=search.distinct_hypotheses,
                )
            )

    diagnose_trials(trials, search, setting.seed, on_event, after={1, len(trials)})
    return rows


def recover(cell: Cell, needs: Mapping[str, Path], folder: Path) -> list[dict[str, Any]]:
    """Returns a row per diagnosis of a recovery, whose later trials depend on the comparator.

    Raises:
        InputError: The comparator cannot compare the trials.
        WorkError: A trial could not be run or read.
    """
    setting = setting_of(cell)
    settings, gait = setting.settings, read_gait(needs["gait"], setting.robot)
    rows: list[AblationRow] = []
    trials: list[Trial] = []
    cost = DiagnosisCost()
    score = choose_score(
        setting.shared["score"],
        setting.entry,
        network_for(setting.robot),
        steps=settings.steps,
        seed=setting.seed,
        gait=gait,
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
                    row_of(setting, cell.part, event, trials[1:], cost),
                    before=before,
                    after=since[0],
                    recovered=max(since[1:], default=None),
                )
            )

    experiment = Experiment(
        robot=setting.robot,
        case=setting.case,
        truth=setting.truth,
        choose_comparator=comparator_choice(plugins.comparator(cell.part)),
        # The trials of an experiment exclude the failing trial.
        settings=dataclasses.replace(settings, trials=settings.trials - 1),
        seed=setting.seed,
        threads=1,
        folder=folder / "recovery",
        gait=gait,
        gap=setting.gap,
        kinds=plugins.kinds(setting.shared["kinds"]),
        next_trial=setting.shared["next_trial"],
        score=score,
        repair=setting.shared["repair"],
        search=setting.shared["search"],
    )
    outcome = run(experiment, on_event)
    rows[-1] = dataclasses.replace(
        rows[-1], distinct_hypotheses=outcome.recovery.distinct_hypotheses
    )
    return as_dicts(rows)
