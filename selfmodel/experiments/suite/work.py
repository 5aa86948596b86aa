"""Execution of a study of many bodies: a grid of gaits, then a grid of recoveries."""

import shutil
from collections.abc import Callable
from pathlib import Path

from selfmodel.controllers.controller import check_silent_neurons
from selfmodel.experiments import plugins, robots, trial_logs
from selfmodel.experiments.arguments import comparator_choice
from selfmodel.experiments.chosen_score import choose_score
from selfmodel.experiments.experiment import Experiment, run as run_experiment
from selfmodel.experiments.gaits import evolve_gait, write_gait
from selfmodel.experiments.grid import GridBegins, Job, PartEnds, PartResult, run_grid
from selfmodel.experiments.study_files import as_dicts
from selfmodel.experiments.suite.plan import Study, check, gait_jobs, gait_path, recovery_jobs
from selfmodel.experiments.suite.rows import SuiteRow
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.kinds.neuron import silent_neurons
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import PAPER_KINDS
from selfmodel.recovery.scores.upright import falls_of
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.trial import Trial


def run_study(
    study: Study,
    *,
    workers: int,
    on_progress: Callable[[GridBegins | PartEnds], None],
    only: tuple[int, int] = (1, 1),
) -> tuple[PartEnds, ...]:
    """Runs the unfinished parts of a study and returns the failed ones.

    Args:
        study: The study.
        workers: Number of worker processes, each with one thread of physics.
        on_progress: Callback of the grid of gaits, then of the grid of recoveries.
        only: ``(i, n)``: share i of n of the gaits and their recoveries, from 1, for n machines
            with a folder each.

    Raises:
        InputError: The study is invalid, or its folder contains another study.
    """
    check(study)
    no_gait = run_grid(
        study.folder / "gaits",
        gait_jobs(study, only),
        _evolve,
        workers=workers,
        on_progress=on_progress,
    )
    jobs = recovery_jobs(study, only)
    failed = run_grid(
        study.folder / "runs", jobs, _recover, workers=workers, on_progress=on_progress
    )
    return no_gait + failed


def _evolve(job: Job, _part: str, run: Path) -> PartResult:
    """Evolves and writes the gait of a body before the failure."""
    parameters = job.parameters
    entry = robots.robot_entry(parameters["body"])
    robot = entry.robot()
    path, settings = run.parent / f"{job.key}.npz", Settings(**parameters["settings"])
    design = plugins.design(parameters["controller"], robot, parameters.get("neurons"))
    chosen = choose_score(parameters["score"], entry, design, steps=settings.steps, seed=job.seed)
    if chosen.gait is not None:
        return write_gait(path, chosen.gait, evaluations=0)
    return evolve_gait(path, robot, settings, job.seed, design=design, score=chosen.score)


def _recover(job: Job, _part: str, run: Path) -> PartResult:
    """Runs the recovery of a body and returns its row, with its trial logs."""
    parameters, shared = job.parameters, job.parameters["shared"]
    entry = robots.robot_entry(parameters["body"])
    robot = entry.robot()
    truth = parse(parameters["truth"], robot.anatomy)
    design = plugins.design(shared["controller"], robot, shared.get("neurons"))
    check_silent_neurons(design, silent_neurons(truth))
    folder = run / "recovery"
    shutil.rmtree(folder, ignore_errors=True)  # files of a killed run
    settings = Settings(**shared["settings"])
    gait = trial_logs.controller(gait_path(run.parents[1], parameters["gait"]), robot)
    chosen = choose_score(
        shared["score"], entry, design, steps=settings.steps, seed=job.seed, gait=gait
    )
    experiment = Experiment(
        robot=robot,
        case=parameters["case"],
        truth=truth,
        choose_comparator=comparator_choice(shared["comparator"]),
        kinds=plugins.kinds(shared["kinds"]) if "kinds" in shared else PAPER_KINDS,
        gap=shared.get("gap", 0.0),
        structure=shared.get("structure", False),
        settings=settings,
        seed=job.seed,
        threads=1,
        folder=folder,
        gait=gait,
        design=design,
        score=chosen.score,
        physical=entry.physical,
    )
    outcome = run_experiment(experiment, on_event=lambda _: None)
    before, *since = outcome.recovery.trials
    score = experiment.score
    after, *recoveries = (score.of_trial(robot, truth, trial) for trial in since)
    diagnosis = outcome.recovery.diagnosis
    row = SuiteRow(
        robot=robot.name,
        case=parameters["case"],
        truth=str(truth),
        seed=job.seed,
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
    )
    return PartResult(as_dicts([row]), sorted((folder / "trials").glob("*.mcap")))


def _stayed_upright(robot: Robot, hidden: Hypothesis, trial: Trial) -> bool:
    """Returns whether the robot did not fall in a physical trial."""
    return bool(falls_of(robot, hidden, trial.behaviour) == trial.behaviour.steps)
