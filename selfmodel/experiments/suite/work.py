"""Cells of a study of many bodies: recoveries."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from selfmodel import plugins
from selfmodel.arguments import comparator_choice
from selfmodel.controllers.controller import check_silent_neurons
from selfmodel.experiments.grid import Cell
from selfmodel.experiments.study.files import as_dicts
from selfmodel.experiments.study.gaits import read_gait
from selfmodel.experiments.study.planned_robots import planned_entry
from selfmodel.experiments.suite.rows import SuiteRow
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.faults.sensors import silent_neurons
from selfmodel.recovery.falls import falls_of
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.studies.experiment import Experiment, run
from selfmodel.studies.scores import choose_score
from selfmodel.trials.trial import Trial


def recover(cell: Cell, needs: Mapping[str, Path], folder: Path) -> list[dict[str, Any]]:
    """Runs the recovery of a body and returns its row."""
    parameters, shared = cell.parameters, cell.parameters["shared"]
    entry = planned_entry(parameters)
    robot = entry.robot()
    truth = parse(parameters["truth"], robot.anatomy)
    design = plugins.design(shared["controller"], robot, shared["neurons"])
    check_silent_neurons(design, silent_neurons(truth))
    settings, gait = Settings(**shared["settings"]), read_gait(needs["gait"], robot)
    score = choose_score(
        shared["score"], entry, design, steps=settings.steps, seed=cell.seed, gait=gait
    ).score
    experiment = Experiment(
        robot=robot,
        case=parameters["case"],
        truth=truth,
        choose_comparator=comparator_choice(shared["comparator"]),
        kinds=plugins.kinds(shared["kinds"]),
        gap=shared["gap"],
        settings=settings,
        seed=cell.seed,
        threads=1,
        folder=folder / "recovery",
        gait=gait,
        design=design,
        score=score,
        physical=entry.physical,
        repair=shared["repair"],
        search=shared["search"],
    )
    outcome = run(experiment, on_event=lambda _: None)
    before, *since = outcome.recovery.trials
    after, *recoveries = (score.of_trial(robot, truth, trial) for trial in since)
    diagnosis = outcome.recovery.diagnosis
    row = SuiteRow(
        robot=robot.name,
        case=parameters["case"],
        truth=str(truth),
        seed=cell.seed,
        best=str(diagnosis.best),
        correct=outcome.correct,
        verdict=diagnosis.verdict,
        trials=len(since),
        before=score.of_trial(robot, INTACT, before),
        after=after,
        recovered=max(recoveries),
        diverged=outcome.stats.diverged,
        seconds=outcome.seconds,
        upright=_stayed_upright(robot, truth, since[1 + recoveries.index(max(recoveries))]),
        repair=shared["repair"],
        search=shared["search"],
    )
    return as_dicts([row])


def _stayed_upright(robot: Robot, hidden: Hypothesis, trial: Trial) -> bool:
    """Returns whether the robot did not fall in a physical trial."""
    return bool(falls_of(robot, hidden, trial.behaviour) == trial.behaviour.steps)
