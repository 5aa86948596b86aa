"""``python -m benchmarks.rivals FOLDER``: methods x robots x cases x gaps x seeds, continued.

Each method has the same damaged physical robots as ``selfmodel recover`` with the same seed and
gap. The rows are in ``FOLDER/results.jsonl``; ``selfmodel compare`` reads them. Needs pyribs and
scikit-learn.
"""

import argparse
import dataclasses
import hashlib
import itertools
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np

from benchmarks.rivals.methods import METHODS, Fitness, Problem
from benchmarks.rows import markdown
from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Controller
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.logs.repertoires import load_repertoire, save_repertoire
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.recovery.candidates import RobustFitness
from selfmodel.recovery.map_elites import make_repertoire, simulated_evaluation
from selfmodel.recovery.scores import UPRIGHT
from selfmodel.robot.designs import network_for
from selfmodel.settings import Settings
from selfmodel.simulation.domain import DomainDistribution, start_spread
from selfmodel.simulation.model_factors import exact, with_model
from selfmodel.simulation.reality_gap import perturbed_model
from selfmodel.simulation.simulator import Simulator
from selfmodel.studies import recoveries
from selfmodel.studies.cells import Cell
from selfmodel.studies.experiment import draw_reality
from selfmodel.studies.rows import AFTER, KINDS, ORACLE, frame_of, method_value, oracles
from selfmodel.studies.study import Row, Study
from selfmodel.tasks import ROBOTS

FILE = "repertoire.npz"
PHYSICAL, HEALTHY, HIDDEN = 1, 2, 3
"""Streams of the noise of the damaged robot, as in a recovery, and of the two fitnesses."""

ORACLE_TRIALS = 6
"""Physical trials whose mean is the value of the oracle."""


def main() -> None:
    """Runs the study, and prints its table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.rivals", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--methods", default=",".join(METHODS))
    parser.add_argument("--robots", default=",".join(ROBOTS))
    parser.add_argument("--cases", default="1,2,4,6")
    parser.add_argument("--gaps", default="0.1")
    parser.add_argument("--seeds", default="0")
    parser.add_argument("--steps", type=int, default=1000)
    parser.add_argument("--trials", type=int, default=20, help="physical trials of a method")
    parser.add_argument("--evolution-trials", type=int, default=500, help="of evolution on it")
    parser.add_argument("--evaluations", type=int, default=6000, help="of a search in simulation")
    parser.add_argument("--population", type=int, default=100)
    parser.add_argument("--period", type=int, default=40, help="generations of T-Resilience")
    parser.add_argument("--repertoire-evaluations", type=int, default=60_000)
    parser.add_argument("--workers", type=int, default=2)
    given = parser.parse_args()
    study = study_of(given)
    failed = study.run(workers=given.workers, on_event=print)
    kind = KINDS["rivals"]
    rows = sorted(
        ({name: row[name] for name in kind.columns} for row in study.rows()), key=kind.order
    )
    text = "".join(f"{json.dumps(row, allow_nan=False)}\n" for row in rows)
    (given.folder / "results.jsonl").write_text(text, encoding="utf-8")
    print(table(rows))
    if failed:
        raise SystemExit("\n".join(f"{end.name} failed: {end.error}" for end in failed))


def study_of(given: argparse.Namespace) -> Study:
    """Returns the study of the options of the command line."""
    names = ("steps", "trials", "evolution_trials", "evaluations", "population", "period")
    shared = {name: getattr(given, name) for name in names}
    models = {robot: recoveries.planned(robot, ROBOTS[robot]) for robot in given.robots.split(",")}
    size = {"steps": given.steps, "evaluations": given.repertoire_evaluations}
    repertoires = {
        robot: Cell(f"{__package__}.__main__:make", robot, {**model, **size}, kind="repertoires")
        for robot, model in models.items()
    }
    points = {
        f"{robot}-case{case}-gap{gap}-seed{seed}-{method}": {
            **models[robot],
            "method": method,
            "case": int(case),
            "truth": ROBOTS[robot].cases[int(case)],
            "gap": float(gap),
            "seed": int(seed),
        }
        for seed, robot, case, gap in itertools.product(
            given.seeds.split(","), models, given.cases.split(","), given.gaps.split(",")
        )
        for method in given.methods.split(",")
    }
    return Study(
        "rivals",
        given.folder,
        f"{__package__}.__main__:run",
        points,
        shared,
        lambda point: (
            {"repertoire": repertoires[point["robot"]]}
            if point["method"] == "trial-and-error"
            else {}
        ),
    )


def make(parameters: Mapping[str, Any], _needs: Mapping[str, Path], folder: Path) -> dict[str, int]:
    """Makes and writes the repertoire of a robot."""
    robot, steps = recoveries.planned_entry(parameters).robot(), parameters["steps"]
    made = make_repertoire(
        robot,
        network_for(robot),
        simulated_evaluation(Simulator(robot, threads=1), INTACT, steps),
        steps=steps,
        seed=0,
        evaluations=parameters["evaluations"],
    )
    save_repertoire(folder / FILE, made)
    return {"gaits": len(made)}


def run(parameters: Mapping[str, Any], needs: Mapping[str, Path], _folder: Path) -> dict[str, Any]:
    """Runs a method on a damaged physical robot, and returns its row.

    ``best`` is the best displacement up to a fall so far, after each physical trial, m;
    ``upright``, ``displacement``, ``fallen`` and ``steps`` are those of each trial.
    """
    start = perf_counter()
    shared, method, seed = (parameters[name] for name in ("shared", "method", "seed"))
    robot, steps = recoveries.planned_entry(parameters).robot(), shared["steps"]
    truth = parse(parameters["truth"], robot.anatomy)
    gap = draw_reality(robot, seed, parameters["gap"])
    simulator = Simulator(robot, threads=1)
    hidden = with_model(robot, perturbed_model(robot.model, gap), robot.control_delay + gap.delay)
    twin = Simulator(hidden, 1, simulator.stats)
    key = int.from_bytes(hashlib.sha256(method.encode()).digest()[:4])
    own = {ORACLE: ORACLE_TRIALS, "physical-evolution": shared["evolution_trials"]}
    problem = Problem(
        physical=SimulatedRobot(robot, truth, gap, PHYSICAL),
        robot=robot,
        normal=build(robot, truth).normal,
        steps=steps,
        trials=own.get(method, shared["trials"]),
        design=network_for(robot),
        settings=Settings().scaled(shared["population"]),
        period=shared["period"],
        evaluations=shared["evaluations"],
        rng=np.random.default_rng([seed, key]),
        evaluate=simulated_evaluation(simulator, INTACT, steps),
        healthy=noisy_fitness(simulator, INTACT, gap.level, steps, (seed, HEALTHY)),
        hidden=noisy_fitness(twin, truth, gap.level, steps, (seed, HIDDEN)),
        repertoire=load_repertoire(needs["repertoire"] / FILE, robot) if needs else None,
    )
    METHODS[method](problem)
    trials = [dataclasses.asdict(trial) for trial in problem.done]
    columns = {name: [trial[name] for trial in trials] for name in trials[0]}
    return {
        "robot": robot.name,
        "best": np.maximum.accumulate(columns["upright"]).tolist(),
        **columns,
        "simulated_steps": simulator.stats.steps,
        "seconds": perf_counter() - start,
    }


def noisy_fitness(
    simulator: Simulator, hypothesis: Hypothesis, level: float, steps: int, key: tuple[int, int]
) -> Fitness:
    """Returns the fitness of controllers under a hypothesis, with the noise of a reality gap.

    Each call has new noise, which its controllers share.
    """
    robot, rng = simulator.robot, np.random.default_rng(key)
    touch = np.array([sensor.kind == "touch" for sensor in robot.anatomy.sensors])
    noise = DomainDistribution(
        models=exact(robot),
        reading_noise=np.where(touch, 0.0, level),
        wrong_touches=np.where(touch, level / 2, 0.0),
        start=start_spread(level),
    )
    fitness = RobustFitness(simulator, UPRIGHT, (hypothesis,), noise)

    def of(controllers: Sequence[Controller]) -> FloatArray:
        scores = fitness(controllers, 1, steps, rng)[:, 0]
        return np.where(np.isfinite(scores), scores, -1.0)

    return of


def table(rows: Sequence[Row]) -> str:
    """Returns medians over the seeds in Markdown: metres up to the first fall, and by the oracle.

    The best of the trials so far counts; of the oracle, the mean of its trials.
    """
    frame = frame_of(rows)
    bounds, lines = oracles(frame), []
    for (robot, case, gap, method), own in frame.groupby(["robot", "case", "gap", "method"]):
        after = {n: [method_value(row, n) for row in own.itertuples()] for n in AFTER}
        bound = [bounds.get((robot, case, gap, seed), 0.0) for seed in own["seed"]]
        ratios = {n: [v / b for v, b in zip(after[n], bound, strict=True) if b > 0] for n in AFTER}
        lines.append(
            {
                "robot": robot,
                "case": str(case),
                "gap": f"{gap:g}",
                "method": method,
                "runs": str(len(own)),
                **{f"m after {n}": f"{median(after[n]):.2f}" for n in AFTER},
                **{f"÷ oracle after {n}": f"{median(ratios[n] or [math.nan]):.2f}" for n in AFTER},
                "trials": f"{own['best'].map(len).median():g}",
                "simulated steps": f"{own['simulated_steps'].median():.3g}",
                "seconds": f"{own['seconds'].median():.0f}",
            }
        )
    return markdown(lines, texts=4)


if __name__ == "__main__":
    main()
