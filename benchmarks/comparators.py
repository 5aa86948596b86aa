"""Cost of comparators relative to physics, and of diagnoses relative to the paper's comparator.

``python -m benchmarks.comparators`` prints the same results as ``make bench``.
"""

import argparse
import json
import os
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from benchmarks.facts import Facts
from selfmodel.comparators import COMPARATORS, FORWARD_DISPLACEMENT
from selfmodel.controllers.controller import Controller
from selfmodel.diagnosis.comparator import Comparator, PiecewiseTrial
from selfmodel.diagnosis.diagnose import DiagnosticSearch
from selfmodel.diagnosis.evidence import simulate
from selfmodel.experiments.ablation.bank import gait
from selfmodel.faults.hypothesis_space import GENE_VALUES, HypothesisSpace
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import PAPER_KINDS
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.calibration import calibrate
from selfmodel.simulation.requests import Ensemble
from selfmodel.simulation.simulator import Simulator
from selfmodel.studies.experiment import draw_reality
from selfmodel.tasks import ROBOTS
from selfmodel.trials.behaviour import collect
from selfmodel.trials.trial import Stage, Trial, TrialPlan

if TYPE_CHECKING:
    from selfmodel.evolution import Generation

ROUNDS = 5
"""Rounds of arithmetic and physics; the result is the median."""

SHARE = 0.25
"""Goal: largest ratio of a comparator's arithmetic to its physics."""

TIMES = 3.0
"""Goal: largest ratio of a diagnosis to one by forward displacement; times the number of members
for a comparator that requests an ensemble."""

CASES = range(1, 10)
"""Cases to diagnose. The cost of refinement depends on the failure."""

GAP = 0.05
"""Reality gap of the robot: without one, a diagnosis has fewer hypotheses to compare."""

BANK = Path(__file__).parent / "bank"
HEALTHY_TRIALS = 2


class Known(NamedTuple):
    """A robot's calibrated model, its healthy trials, and one trial per failure."""

    model: Robot
    healthy: list[Trial]
    failed: dict[int, Trial]


def measure(threads: int, settings: Settings) -> list[Facts]:
    """Returns the cost of each comparator on each robot.

    Args:
        threads: Threads that MuJoCo steps on.
        settings: The paper's, or smaller ones for a test.

    Returns:
        A row per robot and comparator. ``arithmetic_over_physics``: seconds of its request and its
        distances over those of the physics, for one generation's children. ``search_seconds``:
        diagnostic EAs, one per failure, on one trial each. ``diagnosis_seconds``: the same with
        refinement and verdict. ``of_single_diagnoses``: the ratio to forward displacement per
        failure. ``within_goals``: whether every ratio reaches its goal.
    """
    return [row for name in ROBOTS for row in _of_robot(name, threads, settings)]


def _of_robot(name: str, threads: int, settings: Settings) -> list[Facts]:
    known = _known(name, threads, settings)
    shares = {one.name: _share(known, one, threads, settings) for one in COMPARATORS.values()}
    costs: dict[str, list[Facts]] = {one: [] for one in COMPARATORS}
    for trial in known.failed.values():  # the comparators alternate
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
    reality = draw_reality(robot, seed=0, level=GAP)
    gaits = [gait(BANK, name, number) for number in range(HEALTHY_TRIALS)]

    def trial(stage: Stage, truth: str, number: int, controller: Controller) -> Trial:
        plan = TrialPlan(f"{number:02d}-{stage}", stage, controller, settings.steps, 0)
        physical = reality.robot(robot, parse(truth, robot.anatomy), stream=number)
        behaviour = collect(robot.anatomy.names, physical.run(controller, plan.steps))
        return Trial(plan, name, behaviour, f"{plan.name}.mcap")

    healthy = [trial("before", "intact", k, controller) for k, controller in enumerate(gaits)]
    failed = {case: trial("after", entry.cases[case], HEALTHY_TRIALS, gaits[0]) for case in CASES}
    return Known(calibrate(robot, healthy, threads).robot, healthy, failed)


def _share(known: Known, comparator: Comparator, threads: int, settings: Settings) -> Facts:
    """Returns seconds of a comparator's arithmetic and physics, for one generation's children."""
    rounds = [_share_once(known, comparator, threads, settings) for _ in range(ROUNDS + 1)][1:]
    request = comparator.prepare(known.failed[CASES[0]]).request
    members = request.members if isinstance(request, Ensemble) else 1
    return {"members": members} | {key: median(one[key] for one in rounds) for key in rounds[0]}


def _share_once(known: Known, comparator: Comparator, threads: int, settings: Settings) -> Facts:
    children = settings.population - settings.survivors
    genomes = np.random.default_rng(0).random((children, GENE_VALUES * settings.genes))
    space = HypothesisSpace(known.model.anatomy, PAPER_KINDS)
    hypotheses = [space.decode(genome) for genome in genomes]
    simulator = Simulator(known.model, threads)
    trial = known.failed[CASES[0]]
    start = perf_counter()
    prepared = comparator.prepare(trial)
    request_seconds = perf_counter() - start
    simulated = simulate(simulator, prepared.request, trial, hypotheses).behaviour
    start = perf_counter()
    if isinstance(prepared, PiecewiseTrial):
        prepared.losses(simulated)
    else:
        prepared.distances(simulated)
    return {
        "arithmetic_seconds": request_seconds + perf_counter() - start,
        "physics_seconds": simulator.stats.physics_seconds,
    }


def _diagnosis(
    known: Known, trial: Trial, comparator: Comparator, threads: int, settings: Settings
) -> Facts:
    """Returns seconds of a diagnosis and of its search, and the number of evaluated hypotheses."""
    simulator = Simulator(known.model, threads)
    diagnose = DiagnosticSearch(simulator, comparator, settings, PAPER_KINDS, intact=known.healthy)
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
    argparse.ArgumentParser(description=__doc__).parse_args()
    print(json.dumps(measure(os.cpu_count() or 1, Settings()), indent=2))
