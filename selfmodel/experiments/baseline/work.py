"""Execution of a study of baselines: the repertoires, then one part per cell and method."""

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from time import perf_counter

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Controller
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
from selfmodel.experiments.reality import draw_reality
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.logs.repertoires import load_repertoire, save_repertoire
from selfmodel.physical.reality_gap import RealityGap
from selfmodel.recovery.baselines.genome_search import genome_search
from selfmodel.recovery.baselines.measurement import Track
from selfmodel.recovery.baselines.problem import Fitness, Problem
from selfmodel.recovery.baselines.registry import BASELINES
from selfmodel.recovery.repair.cma_es import CmaEs
from selfmodel.recovery.repair.robust_fitness import RobustFitness
from selfmodel.recovery.repertoire.evaluation import simulated_evaluation
from selfmodel.recovery.repertoire.make import make_repertoire
from selfmodel.recovery.scores.upright import UPRIGHT
from selfmodel.recovery.uncertainty import noise_of_gap
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
    path = repertoire_path(folder, parameters["robot"])
    return simulator, Problem(
        track=track,
        design=network_for(robot),
        evaluate=simulated_evaluation(simulator, INTACT, steps),
        healthy=_noisy_fitness(simulator, INTACT, reality.gap, steps, (job.seed, HEALTHY)),
        hidden=_noisy_fitness(
            Simulator(reality.hidden_model(robot), 1, simulator.stats),
            truth,
            reality.gap,
            steps,
            (job.seed, HIDDEN),
        ),
        search=genome_search(
            CmaEs, Settings().scaled(parameters["shared"]["settings"]["population"])
        ),
        repertoire=load_repertoire(path, robot) if method == WITH_REPERTOIRE else None,
    )


def _noisy_fitness(
    simulator: Simulator, hypothesis: Hypothesis, gap: RealityGap, steps: int, key: tuple[int, int]
) -> Fitness:
    """Returns the fitness of controllers under a hypothesis, with the noise of a reality gap.

    Each call has new noise, which its controllers share.

    Args:
        simulator: Simulator of the robot.
        hypothesis: Faults of the robot.
        gap: The reality gap, of which the level counts.
        steps: Control steps of a rollout.
        key: Seed of the noise.
    """
    noise, rng = noise_of_gap(simulator.robot, gap.level), np.random.default_rng(key)
    fitness = RobustFitness(simulator, UPRIGHT, (hypothesis,), noise)

    def of(controllers: Sequence[Controller]) -> FloatArray:
        scores = fitness(controllers, 1, steps, rng)[:, 0]
        return np.where(np.isfinite(scores), scores, -1.0)

    return of
