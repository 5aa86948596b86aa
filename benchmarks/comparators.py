"""What comparing costs beside simulating, and a diagnosis by each comparator beside the paper's.

Run by itself (``python -m benchmarks.comparators``) it prints what ``make bench`` keeps of it.
"""

import json
import os
from collections.abc import Callable
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from benchmarks.results import Facts
from selfmodel.behaviour import collect
from selfmodel.calibrate import calibrate
from selfmodel.cli.ablation.bank import gait
from selfmodel.cli.reality import draw_reality
from selfmodel.comparator import Comparator, Ensemble, Piecewise
from selfmodel.comparators import COMPARATORS, FORWARD_DISPLACEMENT
from selfmodel.diagnose import Diagnose
from selfmodel.driver import Evolved
from selfmodel.evidence import simulate
from selfmodel.faults import PAPER_KINDS
from selfmodel.genome import VALUES, decode
from selfmodel.notation import parse
from selfmodel.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulator import Simulator
from selfmodel.tasks import ROBOTS
from selfmodel.trial import Plan, Stage, Trial

if TYPE_CHECKING:
    from selfmodel.evolution import Generation

ROUNDS = 3
"""Rounds of every comparison, in which the comparators take turns; the medians are compared."""

SHARE = 0.25
"""The goal: the most that a comparator's arithmetic may take of the physics that it needs."""

TIMES = 3.0
"""The goal: the most that a diagnosis may take of one by forward displacement, once for every
member where a comparator asks for an ensemble."""

CASE = 7
"""The failure that is diagnosed: a compound of two."""

GAP = 0.05
"""The gap of the robot that fails: without one, a diagnosis has less to weigh."""

BANK = Path(__file__).parent / "bank"
HEALTHY_TRIALS = 2


class Known(NamedTuple):
    """What is known of a robot that failed: its calibrated model, healthy trials, and one since."""

    model: Robot
    intact: list[Trial]
    trial: Trial


def measure(threads: int, settings: Settings) -> list[Facts]:
    """Returns what each comparator costs on each robot.

    Args:
        threads: Threads that MuJoCo steps on.
        settings: The paper's, or smaller ones to see that this works.

    Returns:
        A row a robot and comparator. ``arithmetic_over_physics``: seconds of its request and its
        distances over those of the physics, for one generation's children. ``search_seconds``: a
        diagnostic EA against one trial. ``diagnosis_seconds``: the same and what follows, where a
        comparator that judges in pieces has its result refined by more hypotheses, and weighs them
        against how well the healthy robot was predicted.
    """
    return [row for name in ROBOTS for row in _of_robot(name, threads, settings)]


def _of_robot(name: str, threads: int, settings: Settings) -> list[Facts]:
    known = _known(name, threads, settings)
    shares = _in_turns(lambda one: _share(known, one, threads, settings))
    costs = _in_turns(lambda one: _diagnosis(known, one, threads, settings))
    usual = costs[FORWARD_DISPLACEMENT.name]
    rows = []
    for comparator in COMPARATORS.values():
        request = comparator.request(known.trial)
        members = request.members if isinstance(request, Ensemble) else 1
        share, cost = shares[comparator.name], costs[comparator.name]
        parts = share["arithmetic_seconds"] / share["physics_seconds"]
        whole = cost["diagnosis_seconds"] / usual["diagnosis_seconds"]
        rows.append(
            {
                "robot": name,
                "comparator": comparator.name,
                "members": members,
                **share,
                **cost,
                "arithmetic_over_physics": parts,
                "search_over_forward_displacement": cost["search_seconds"]
                / usual["search_seconds"],
                "diagnosis_over_forward_displacement": whole,
                "within_goals": parts <= SHARE and whole <= TIMES * members,
            }
        )
    return rows


def _known(name: str, threads: int, settings: Settings) -> Known:
    entry = ROBOTS[name]
    robot = entry.robot()
    reality = draw_reality(robot, seed=0, level=GAP, structure=False)
    gaits = [gait(BANK, name, number) for number in range(HEALTHY_TRIALS)]

    def trial(stage: Stage, truth: str, number: int, controller: Evolved) -> Trial:
        plan = Plan(f"{number:02d}-{stage}", stage, controller, settings.steps, 0)
        physical = reality.robot(robot, parse(truth, robot.anatomy), stream=number)
        behaviour = collect(robot.anatomy.names, physical.run(controller, plan.steps))
        return Trial(plan, name, behaviour, f"{plan.name}.mcap")

    intact = [trial("before", "intact", k, controller) for k, controller in enumerate(gaits)]
    failed = trial("after", entry.cases[CASE], HEALTHY_TRIALS, gaits[0])
    return Known(calibrate(robot, intact, threads).robot, intact, failed)


def _in_turns(work: Callable[[Comparator], dict[str, float]]) -> dict[str, dict[str, float]]:
    """The median of each number of each comparator, after a round of warm-up."""
    rounds = [
        {name: work(comparator) for name, comparator in COMPARATORS.items()}
        for _ in range(ROUNDS + 1)
    ][1:]
    return {
        name: {key: median(turn[name][key] for turn in rounds) for key in rounds[0][name]}
        for name in COMPARATORS
    }


def _share(
    known: Known, comparator: Comparator, threads: int, settings: Settings
) -> dict[str, float]:
    """Seconds of a comparator's arithmetic, and of the physics, for one generation's children."""
    children = settings.population - settings.survivors
    genomes = np.random.default_rng(0).random((children, VALUES * settings.genes))
    hypotheses = [decode(genome, known.model.anatomy, PAPER_KINDS) for genome in genomes]
    simulator = Simulator(known.model, threads)
    start = perf_counter()
    request = comparator.request(known.trial)
    asked = perf_counter() - start
    simulated = simulate(simulator, request, known.trial, hypotheses).behaviour
    start = perf_counter()
    if isinstance(comparator, Piecewise):
        comparator.losses(simulated, known.trial)
    else:
        comparator.distances(simulated, known.trial)
    return {
        "arithmetic_seconds": asked + perf_counter() - start,
        "physics_seconds": simulator.tally.physics_seconds,
    }


def _diagnosis(
    known: Known, comparator: Comparator, threads: int, settings: Settings
) -> dict[str, float]:
    """Seconds of one diagnosis and of its search, and how many hypotheses they looked at."""
    simulator = Simulator(known.model, threads)
    diagnose = Diagnose(simulator, comparator, settings, intact=known.intact)
    generations: list[Generation] = []
    start = perf_counter()
    diagnose([known.trial], [], np.random.default_rng(0), generations.append)
    return {
        "diagnosis_seconds": perf_counter() - start,
        "diagnosis_evaluations": diagnose.evaluations,
        "search_seconds": generations[-1].seconds,
        "search_evaluations": generations[-1].evaluations,
        "distinct_hypotheses": diagnose.distinct_hypotheses,
    }


if __name__ == "__main__":
    print(json.dumps(measure(os.cpu_count() or 1, Settings()), indent=2))
