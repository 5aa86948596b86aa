"""Oracle: the best controller for the physical robot's own hidden model with its noise.

A recovery is compared with what the damaged body can do, because a ratio to a poor gait before the
failure flatters.
"""

from dataclasses import asdict
from time import perf_counter
from typing import Any

import numpy as np

from benchmarks.recoveries.cells import HEALTHY, Cell
from selfmodel.controllers.controller import Controller
from selfmodel.physical.interface import PhysicalRobot
from selfmodel.recovery.repair.robust_fitness import robust
from selfmodel.recovery.repair.robust_repair import RobustRepair
from selfmodel.recovery.scores.upright import UPRIGHT
from selfmodel.recovery.uncertainty import noise_of_gap
from selfmodel.robot.designs import network_for
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import collect
from selfmodel.trials.trial import Trial, TrialPlan

SEARCHES = 2
"""Searches of an oracle, of which the best counts."""

CONTINUED = 1
"""Number of times that a search is continued from its best controllers: a single search of this
cost ends up to a fifth below another one."""

RUNS = 12
"""Physical runs of the best controller, whose mean displacement is the oracle's."""


def oracle(cell: Cell, *, settings: Settings) -> dict[str, Any]:
    """Returns the row of an oracle: the mean upright displacement of its controller, m.

    Args:
        cell: The failure.
        settings: The paper's numbers, which set the cost of a search.
    """
    start = perf_counter()
    robot = cell.nominal
    hidden = cell.reality.hidden_model(robot)
    noise = noise_of_gap(hidden, cell.gap)
    repair = RobustRepair(Simulator(hidden, 1), settings, network_for(robot), UPRIGHT)
    found: list[Any] = []
    for number in range(SEARCHES):
        rng, seeds = np.random.default_rng((cell.seed, cell.case, number)), list[Controller]()
        for _ in range(1 + CONTINUED):
            ends = repair((cell.truth,), lambda: noise, seeds, rng, lambda _generation: None)
            seeds = [candidate.controller for candidate in ends]
        found += ends[:1]
    best = max(found, key=lambda candidate: float(robust(candidate.scores[np.newaxis])[0]))
    physical = cell.reality.robot(robot, cell.truth, stream=0 if cell.case == HEALTHY else 1)
    runs = [_run(cell, physical, best.controller, settings.steps) for _ in range(RUNS)]
    return {
        **asdict(cell),
        "upright": round(float(np.mean(runs)), 4),
        "lowest": round(min(runs), 4),
        "predicted": round(best.predicted, 4),
        "evaluations": repair.evaluations,
        "seconds": round(perf_counter() - start, 1),
    }


def _run(cell: Cell, physical: PhysicalRobot, controller: Controller, steps: int) -> float:
    """Returns the upright displacement of one physical run, m."""
    names = cell.nominal.anatomy.names
    plan = TrialPlan("oracle", "single", controller, steps, cell.seed)
    trial = Trial(plan, cell.robot, collect(names, physical.run(controller, steps)), "oracle")
    return UPRIGHT.of_trial(cell.nominal, cell.truth, trial)
