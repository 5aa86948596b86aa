"""What comparing costs beside simulating, and a diagnosis by each comparator beside the paper's.

Run by itself (``python -m benchmarks.comparators``) it prints what ``make bench`` keeps of it.
"""

import json
import os
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from benchmarks.results import Facts
from selfmodel.comparators import COMPARATORS, FORWARD_DISPLACEMENT
from selfmodel.controllers.controller import Controller
from selfmodel.diagnosis.comparator import Comparator, Piecewise
from selfmodel.diagnosis.diagnose import DiagnosticSearch
from selfmodel.diagnosis.evidence import simulate
from selfmodel.diagnosis.genome import VALUES, decode
from selfmodel.experiments.ablation.bank import gait
from selfmodel.experiments.reality import draw_reality
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import PAPER_KINDS
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.calibrate import calibrate
from selfmodel.simulation.requests import Ensemble
from selfmodel.simulation.simulator import Simulator
from selfmodel.tasks import ROBOTS
from selfmodel.trials.behaviour import collect
from selfmodel.trials.trial import Stage, Trial, TrialPlan

if TYPE_CHECKING:
    from selfmodel.evolution import Generation

ROUNDS = 5
"""Rounds in which arithmetic is compared with physics; the medians are kept."""

SHARE = 0.25
"""The goal: the most that a comparator's arithmetic may take of the physics that it needs."""

TIMES = 3.0
"""The goal: the most that a diagnosis may take of one by forward displacement, once for every
member where a comparator asks for an ensemble."""

CASES = range(1, 10)
"""The failures that are diagnosed. How much there is to refine depends on what has failed."""

GAP = 0.05
"""The gap of the robot that fails: without one, a diagnosis has less to weigh."""

BANK = Path(__file__).parent / "bank"
HEALTHY_TRIALS = 2


class Known(NamedTuple):
    """What is known of a robot: its calibrated model, healthy trials, and one of each failure."""

    model: Robot
    intact: list[Trial]
    failed: dict[int, Trial]


def measure(threads: int, settings: Settings) -> list[Facts]:
    """Returns what each comparator costs on each robot.

    Args:
        threads: Threads that MuJoCo steps on.
        settings: The paper's, or smaller ones to see that this works.

    Returns:
        A row a robot and comparator. ``arithmetic_over_physics``: seconds of its request and its
        distances over those of the physics, for one generation's children. ``search_seconds``:
        diagnostic EAs against one trial each, one for every failure. ``diagnosis_seconds``: the
        same and what follows, where a comparator that judges in pieces has its result refined by
        more hypotheses, and weighs them against how well the healthy robot was predicted.
        ``of_single_diagnoses``: the ratio to forward displacement, failure by failure;
        ``within_goals`` if it is for every one.
    """
    return [row for name in ROBOTS for row in _of_robot(name, threads, settings)]


def _of_robot(name: str, threads: int, settings: Settings) -> list[Facts]:
    known = _known(name, threads, settings)
    shares = {one.name: _share(known, one, threads, settings) for one in COMPARATORS.values()}
    costs: dict[str, list[Facts]] = {one: [] for one in COMPARATORS}
    for trial in known.failed.values():  # the comparators take turns
        for one, comparator in COMPARATORS.items():
            costs[one].append(_diagnosis(known, trial, comparator, threads, settings))
    usual = costs[FORWARD_DISPLACEMENT.name]
    return [
        {"robot": name, "comparator": one} | _row(shares[one], costs[one], usual)
        for one in COMPARATORS
    ]


def _row(share: Facts, costs: list[Facts], usual: list[Facts]) -> Facts:
    parts = share["arithmetic_seconds"] / share["physics_seconds"]
    total, of_usual = _summed(costs), _summed(usual)
    singles = [
        one["diagnosis_seconds"] / other["diagnosis_seconds"]
        for one, other in zip(costs, usual, strict=True)
    ]
    return {
        **share,
        "diagnoses": len(costs),
        **total,
        "arithmetic_over_physics": parts,
        "search_over_forward_displacement": total["search_seconds"] / of_usual["search_seconds"],
        "diagnosis_over_forward_displacement": total["diagnosis_seconds"]
        / of_usual["diagnosis_seconds"],
        "of_single_diagnoses": singles,
        "within_goals": parts <= SHARE and max(singles) <= TIMES * share["members"],
    }


def _summed(costs: list[Facts]) -> Facts:
    return {key: sum(cost[key] for cost in costs) for key in costs[0]}


def _known(name: str, threads: int, settings: Settings) -> Known:
    entry = ROBOTS[name]
    robot = entry.robot()
    reality = draw_reality(robot, seed=0, level=GAP, structure=False)
    gaits = [gait(BANK, name, number) for number in range(HEALTHY_TRIALS)]

    def trial(stage: Stage, truth: str, number: int, controller: Controller) -> Trial:
        plan = TrialPlan(f"{number:02d}-{stage}", stage, controller, settings.steps, 0)
        physical = reality.robot(robot, parse(truth, robot.anatomy), stream=number)
        behaviour = collect(robot.anatomy.names, physical.run(controller, plan.steps))
        return Trial(plan, name, behaviour, f"{plan.name}.mcap")

    intact = [trial("before", "intact", k, controller) for k, controller in enumerate(gaits)]
    failed = {case: trial("after", entry.cases[case], HEALTHY_TRIALS, gaits[0]) for case in CASES}
    return Known(calibrate(robot, intact, threads).robot, intact, failed)


def _share(known: Known, comparator: Comparator, threads: int, settings: Settings) -> Facts:
    """Seconds of a comparator's arithmetic, and of the physics, for one generation's children."""
    rounds = [_share_once(known, comparator, threads, settings) for _ in range(ROUNDS + 1)][1:]
    request = comparator.request(known.failed[CASES[0]])
    members = request.members if isinstance(request, Ensemble) else 1
    return {"members": members} | {key: median(one[key] for one in rounds) for key in rounds[0]}


def _share_once(known: Known, comparator: Comparator, threads: int, settings: Settings) -> Facts:
    children = settings.population - settings.survivors
    genomes = np.random.default_rng(0).random((children, VALUES * settings.genes))
    hypotheses = [decode(genome, known.model.anatomy, PAPER_KINDS) for genome in genomes]
    simulator = Simulator(known.model, threads)
    trial = known.failed[CASES[0]]
    start = perf_counter()
    request = comparator.request(trial)
    asked = perf_counter() - start
    simulated = simulate(simulator, request, trial, hypotheses).behaviour
    start = perf_counter()
    if isinstance(comparator, Piecewise):
        comparator.losses(simulated, trial)
    else:
        comparator.distances(simulated, trial)
    return {
        "arithmetic_seconds": asked + perf_counter() - start,
        "physics_seconds": simulator.stats.physics_seconds,
    }


def _diagnosis(
    known: Known, trial: Trial, comparator: Comparator, threads: int, settings: Settings
) -> Facts:
    """Seconds of one diagnosis and of its search, and how much they looked at."""
    simulator = Simulator(known.model, threads)
    diagnose = DiagnosticSearch(simulator, comparator, settings, intact=known.intact)
    generations: list[Generation] = []
    start = perf_counter()
    diagnose([trial], [], np.random.default_rng(0), generations.append)
    return {
        "diagnosis_seconds": perf_counter() - start,
        "diagnosis_evaluations": diagnose.evaluations,
        "search_seconds": generations[-1].seconds,
        "search_evaluations": generations[-1].evaluations,
        "distinct_hypotheses": diagnose.distinct_hypotheses,
        "control_steps": simulator.stats.steps,
    }


if __name__ == "__main__":
    print(json.dumps(measure(os.cpu_count() or 1, Settings()), indent=2))
