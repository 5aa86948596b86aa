"""Execution of a study of baselines: the repertoires, then one part per cell and method."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from time import perf_counter

import numpy as np

from selfmodel.experiments import robots
from selfmodel.experiments.baseline.plan import (
    WITH_REPERTOIRE,
    BaselineStudy,
    cell_jobs,
    check,
    method_key,
    repertoire_jobs,
    repertoire_path,
    settings_of,
)
from selfmodel.experiments.baseline.results import BaselineRow
from selfmodel.experiments.grid import GridBegins, Job, PartEnds, PartResult, run_grid
from selfmodel.experiments.reality import Reality, draw_reality
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.logs.repertoires import load_repertoire, save_repertoire
from selfmodel.physical.reality_gap import RealityGap
from selfmodel.recovery.baselines.ea_search import ea_search
from selfmodel.recovery.baselines.measurement import Track, fitness_on
from selfmodel.recovery.baselines.problem import Problem
from selfmodel.recovery.baselines.registry import BASELINES
from selfmodel.recovery.repertoire.evaluation import simulated_evaluation
from selfmodel.recovery.repertoire.make import make_repertoire
from selfmodel.robot.designs import network_for
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator

PHYSICAL, HEALTHY, HIDDEN = 1, 2, 3
"""Streams of the noise of the damaged robot, as in a recovery, and of the two fitnesses."""


def run_study(
    study: BaselineStudy,
    *,
    workers: int,
    on_progress: Callable[[GridBegins | PartEnds], None],
    only: tuple[int, int] = (1, 1),
) -> tuple[PartEnds, ...]:
    """Runs the unfinished parts of a study and returns the failed ones.

    Args:
        study: The study.
        workers: Number of worker processes, each with one thread of physics.
        on_progress: Callback of the grid of repertoires, then of the grid of cells.
        only: ``(i, n)``: share i of n of the cells, from 1, for n machines with a folder each.

    Raises:
        InputError: The study is invalid, or its folder contains another study.
    """
    check(study)
    jobs = repertoire_jobs(study)
    missing = (
        run_grid(
            study.folder / "repertoires", jobs, _make, workers=workers, on_progress=on_progress
        )
        if jobs
        else ()
    )
    failed = run_grid(
        study.folder / "runs",
        cell_jobs(study, only),
        _run,
        workers=workers,
        on_progress=on_progress,
    )
    return missing + failed


def _make(job: Job, _part: str, run: Path) -> PartResult:
    """Makes and writes the repertoire of a robot."""
    parameters = job.parameters
    robot = robots.robot_entry(parameters["robot"]).robot()
    steps = parameters["steps"]
    made = make_repertoire(
        robot,
        network_for(robot),
        simulated_evaluation(Simulator(robot, threads=1), INTACT, steps),
        steps=steps,
        seed=job.seed,
        evaluations=parameters["evaluations"],
    )
    path = repertoire_path(run.parents[1], parameters["robot"])
    save_repertoire(path, made)
    return PartResult({"gaits": len(made)}, [path])


def _run(job: Job, method: str, run: Path) -> PartResult:
    """Runs a method on a damaged physical robot and returns its row."""
    start, parameters = perf_counter(), job.parameters
    simulator, problem = _problem(job, method, run.parents[1])
    rng = np.random.default_rng([job.seed, method_key(method)])
    settings = settings_of(parameters["shared"], method)
    trials = BASELINES[method](problem, settings, rng, lambda _trial: None)
    row = BaselineRow(
        method=method,
        robot=problem.track.robot.name,
        case=parameters["case"],
        truth=parameters["truth"],
        gap=parameters["gap"],
        seed=job.seed,
        best=[trial.best for trial in trials],
        upright=[trial.measured.upright for trial in trials],
        displacement=[trial.measured.displacement for trial in trials],
        fallen=[trial.measured.fallen for trial in trials],
        steps=[trial.measured.steps for trial in trials],
        simulated_steps=simulator.stats.steps,
        seconds=perf_counter() - start,
    )
    return PartResult(dataclasses.asdict(row))


def _problem(job: Job, method: str, folder: Path) -> tuple[Simulator, Problem]:
    """Returns the problem of a cell, and the simulator that counts its simulated steps."""
    parameters = job.parameters
    robot, steps = robots.robot_entry(parameters["robot"]).robot(), parameters["shared"]["steps"]
    truth = parse(parameters["truth"], robot.anatomy)
    reality = draw_reality(robot, job.seed, parameters["gap"], structure=False)
    simulator = Simulator(robot, threads=1)
    track = Track(reality.robot(robot, truth, PHYSICAL), robot, build(robot, truth).normal, steps)
    noisy = Reality(noise_of(reality.gap), None).robot(robot, INTACT, HEALTHY)
    healthy = Track(noisy, robot, build(robot, INTACT).normal, steps)
    hidden = dataclasses.replace(track, physical=reality.robot(robot, truth, HIDDEN))
    path = repertoire_path(folder, parameters["robot"])
    return simulator, Problem(
        track=track,
        design=network_for(robot),
        evaluate=simulated_evaluation(simulator, INTACT, steps),
        healthy=fitness_on(healthy, simulator.stats),
        hidden=fitness_on(hidden, simulator.stats),
        search=ea_search(Settings().scaled(parameters["shared"]["settings"]["population"])),
        repertoire=load_repertoire(path, robot) if method == WITH_REPERTOIRE else None,
    )


def noise_of(gap: RealityGap) -> RealityGap:
    """Returns a reality gap with the noise of sensors and start alone: no factors, no delay."""
    return dataclasses.replace(
        gap, mass={}, inertia={}, friction=1.0, damping=1.0, motors={}, delay=0
    )
