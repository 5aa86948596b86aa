"""Runs a study: first the gaits before the failure, then the recoveries that begin with them."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from selfmodel.controllers.controller import check_silent_neurons
from selfmodel.experiments import plugins, robots, trial_logs
from selfmodel.experiments.experiment import Experiment, run as run_experiment
from selfmodel.experiments.grid import GridBegins, Job, PartEnds, run_grid
from selfmodel.experiments.suite.plan import Study, check, gait_jobs, gait_path, recovery_jobs
from selfmodel.experiments.suite.rows import Row, as_objects
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.neuron import silent_neurons
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import PAPER_KINDS
from selfmodel.logs.atomic import write_atomic
from selfmodel.logs.controllers import controller_bytes
from selfmodel.recovery.events import Event
from selfmodel.recovery.fitness import Score
from selfmodel.recovery.random_streams import repair_stream
from selfmodel.recovery.repair import RepairSearch
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.trial import Trial


def run_study(
    study: Study,
    *,
    workers: int,
    on_event: Callable[[GridBegins | PartEnds], None],
    only: tuple[int, int] = (1, 1),
) -> tuple[PartEnds, ...]:
    """Runs what has not been run yet, and returns what failed.

    Args:
        study: What to run.
        workers: Processes at a time, each with one thread of physics.
        on_event: Is told what happens, of the gaits' grid and then of the recoveries'.
        only: ``(i, n)``: the recoveries of every n-th gait, from the i-th, counted from 1.

    Raises:
        InputError: Something about it is wrong, or its folder holds another.
    """
    check(study)
    no_gait = run_grid(
        study.folder / "gaits", gait_jobs(study, only), _evolve, workers=workers, on_event=on_event
    )
    jobs = recovery_jobs(study, only)
    failed = run_grid(study.folder / "runs", jobs, _recover, workers=workers, on_event=on_event)
    return no_gait + failed


def _evolve(job: Job, _part: str, run: Path) -> Any:  # noqa: ANN401  # JSON
    """Evolves a gait as a recovery with that seed begins, and keeps it."""
    said = job.parameters
    entry = robots.robot_entry(said["body"])
    robot = entry.robot()
    repair = RepairSearch(
        Simulator(robot, threads=1),
        Settings(**said["settings"]),
        plugins.design(said["controller"], robot, said.get("neurons")),
        score=plugins.score(said["score"], said["body"], entry),
    )
    found = repair(INTACT, (), repair_stream(job.seed, 0), _ignore)
    write_atomic(run.parent / f"{job.key}.npz", controller_bytes(found))
    return {"evaluations": repair.evaluations}


def _recover(job: Job, _part: str, run: Path) -> Any:  # noqa: ANN401  # JSON
    """Lets a body fail and recover, and returns its row."""
    said, shared = job.parameters, job.parameters["shared"]
    entry = robots.robot_entry(said["body"])
    robot = entry.robot()
    truth = parse(said["truth"], robot.anatomy)
    design = plugins.design(shared["controller"], robot, shared.get("neurons"))
    check_silent_neurons(design, silent_neurons(truth))
    folder = run / "recovery"
    shutil.rmtree(folder, ignore_errors=True)  # what is left of a run that was killed
    experiment = Experiment(
        robot=robot,
        case=said["case"],
        truth=truth,
        comparator=plugins.comparator(shared["comparator"]),
        kinds=plugins.kinds(shared["kinds"]) if "kinds" in shared else PAPER_KINDS,
        gap=shared.get("gap", 0.0),
        structure=shared.get("structure", False),
        settings=Settings(**shared["settings"]),
        seed=job.seed,
        threads=1,
        folder=folder,
        gait=trial_logs.controller(gait_path(run.parents[1], said["gait"]), robot),
        design=design,
        score=plugins.score(shared["score"], said["body"], entry),
        physical=entry.physical,
    )
    outcome = run_experiment(experiment, _ignore)
    before, *since = outcome.recovery.trials
    after, *recoveries = (_worth(experiment.score, robot, truth, trial) for trial in since)
    diagnosis = outcome.recovery.diagnosis
    row = Row(
        robot=robot.name,
        case=said["case"],
        truth=str(truth),
        seed=job.seed,
        best=str(diagnosis.best),
        correct=outcome.correct,
        verdict=diagnosis.verdict,
        trials=len(since),
        before=_worth(experiment.score, robot, INTACT, before),
        after=after,
        recovered=max(recoveries),
        diverged=outcome.stats.diverged,
        seconds=outcome.seconds,
    )
    return as_objects([row])


def _worth(score: Score, robot: Robot, hidden: Hypothesis, trial: Trial) -> float:
    """The score of a physical trial."""
    shown = trial.behaviour
    signals = {signal: shown[signal][np.newaxis] for signal in score.record}
    return float(score.of(robot, hidden, Behaviour(shown.names, shown.time, signals))[0])


def _ignore(_event: Event) -> None:
    """Nobody looks on."""
