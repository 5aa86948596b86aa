"""Cells of a study of baselines: repertoires, and methods on damaged physical robots."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Controller
from selfmodel.experiments.baseline.plan import method_key, settings_of
from selfmodel.experiments.baseline.results import BaselineRow
from selfmodel.experiments.grid import Cell
from selfmodel.experiments.study.planned_robots import planned_entry
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.logs.repertoires import load_repertoire, save_repertoire
from selfmodel.recovery.baselines.genome_search import genome_search
from selfmodel.recovery.baselines.measurement import Track
from selfmodel.recovery.baselines.problem import Fitness, Problem
from selfmodel.recovery.baselines.registry import BASELINES
from selfmodel.recovery.cma_es import CmaEs
from selfmodel.recovery.repertoire.evaluation import simulated_evaluation
from selfmodel.recovery.repertoire.make import make_repertoire
from selfmodel.recovery.robust_repair import RobustFitness
from selfmodel.recovery.scores import UPRIGHT
from selfmodel.recovery.uncertainty import noise_of_gap
from selfmodel.robot.designs import network_for
from selfmodel.settings import Settings
from selfmodel.simulation.reality_gap import RealityGap
from selfmodel.simulation.simulator import Simulator
from selfmodel.studies.experiment import draw_reality

FILE = "repertoire.npz"
"""File of a repertoire in the folder of its cell."""

PHYSICAL, HEALTHY, HIDDEN = 1, 2, 3
"""Streams of the noise of the damaged robot, as in a recovery, and of the two fitnesses."""


def make(cell: Cell, _needs: Mapping[str, Path], folder: Path) -> dict[str, Any]:
    """Makes and writes the repertoire of a robot."""
    parameters = cell.parameters
    robot = planned_entry(parameters).robot()
    steps = parameters["steps"]
    made = make_repertoire(
        robot,
        network_for(robot),
        simulated_evaluation(Simulator(robot, threads=1), INTACT, steps),
        steps=steps,
        seed=cell.seed,
        evaluations=parameters["evaluations"],
    )
    save_repertoire(folder / FILE, made)
    return {"gaits": len(made)}


def run(cell: Cell, needs: Mapping[str, Path], _folder: Path) -> dict[str, Any]:
    """Runs a method on a damaged physical robot and returns its row."""
    start, parameters, method = perf_counter(), cell.parameters, cell.part
    simulator, problem = problem_of(cell, needs)
    rng = np.random.default_rng([cell.seed, method_key(method)])
    settings = settings_of(parameters["shared"], method)
    trials = BASELINES[method](problem, settings, rng, lambda _trial: None)
    row = BaselineRow(
        method=method,
        robot=problem.track.robot.name,
        case=parameters["case"],
        truth=parameters["truth"],
        gap=parameters["gap"],
        seed=cell.seed,
        best=[trial.best for trial in trials],
        upright=[trial.measured.upright for trial in trials],
        displacement=[trial.measured.displacement for trial in trials],
        fallen=[trial.measured.fallen for trial in trials],
        steps=[trial.measured.steps for trial in trials],
        simulated_steps=simulator.stats.steps,
        seconds=perf_counter() - start,
    )
    return dataclasses.asdict(row)


def problem_of(cell: Cell, needs: Mapping[str, Path]) -> tuple[Simulator, Problem]:
    """Returns the problem of a cell, and the simulator that counts its simulated steps."""
    parameters = cell.parameters
    robot, steps = planned_entry(parameters).robot(), parameters["shared"]["steps"]
    truth = parse(parameters["truth"], robot.anatomy)
    reality = draw_reality(robot, cell.seed, parameters["gap"])
    simulator = Simulator(robot, threads=1)
    track = Track(reality.robot(robot, truth, PHYSICAL), robot, build(robot, truth).normal, steps)
    return simulator, Problem(
        track=track,
        design=network_for(robot),
        evaluate=simulated_evaluation(simulator, INTACT, steps),
        healthy=_noisy_fitness(simulator, INTACT, reality.gap, steps, (cell.seed, HEALTHY)),
        hidden=_noisy_fitness(
            Simulator(reality.hidden_model(robot), 1, simulator.stats),
            truth,
            reality.gap,
            steps,
            (cell.seed, HIDDEN),
        ),
        search=genome_search(
            CmaEs, Settings().scaled(parameters["shared"]["settings"]["population"])
        ),
        repertoire=load_repertoire(needs["repertoire"] / FILE, robot) if needs else None,
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
