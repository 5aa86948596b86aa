"""Cells of the paper's experiment: recoveries, and evolution on the robot.

Both evolve with the paper's exact repair EA, as the gaits do, whatever other commands use by
default.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from selfmodel.arguments import comparator_choice
from selfmodel.controllers.controller import Controller
from selfmodel.evolution import Generation
from selfmodel.experiments.grid import Cell
from selfmodel.experiments.paper.rows import EvolutionRow, rows_of
from selfmodel.experiments.study.files import as_dicts
from selfmodel.experiments.study.gaits import read_gait
from selfmodel.experiments.study.planned_robots import planned_entry
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import PAPER_KINDS
from selfmodel.recovery.random_streams import repair_stream
from selfmodel.recovery.repair import RepairSearch
from selfmodel.recovery.scores import DISPLACEMENT
from selfmodel.recovery.uncertainty import assumed_uncertainty
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.studies.experiment import Experiment, run


@dataclass(frozen=True, eq=False)
class _Given:
    """What a recovery and the evolution on the robot have in common.

    Attributes:
        robot: The robot.
        truth: Its failure.
        settings: Parameters of the search.
        gait: Controller before the failure.
    """

    robot: Robot
    truth: Hypothesis
    settings: Settings
    gait: Controller


def _given(cell: Cell, needs: Mapping[str, Path]) -> _Given:
    robot = planned_entry(cell.parameters).robot()
    return _Given(
        robot=robot,
        truth=parse(cell.parameters["truth"], robot.anatomy),
        settings=Settings(**cell.parameters["shared"]["settings"]),
        gait=read_gait(needs["gait"], robot),
    )


def recover(cell: Cell, needs: Mapping[str, Path], folder: Path) -> dict[str, Any]:
    """Runs a recovery as in the paper and returns its rows.

    There is no reality gap, so the self-model is exact and is not calibrated.
    """
    given = _given(cell, needs)
    experiment = Experiment(
        robot=given.robot,
        case=cell.parameters["case"],
        truth=given.truth,
        choose_comparator=comparator_choice(cell.part),
        kinds=PAPER_KINDS,
        settings=given.settings,
        seed=cell.seed,
        threads=1,
        folder=folder / "recovery",
        gait=given.gait,
        calibrated=False,
    )
    outcome = run(experiment, on_event=lambda _: None)
    recovery, trials = rows_of(experiment, cell.part, outcome)
    return {"recoveries": as_dicts([recovery]), "trials": as_dicts(trials)}


def evolve_on_robot(cell: Cell, needs: Mapping[str, Path], _folder: Path) -> dict[str, Any]:
    """Runs the repair EA on the damaged robot, as the paper's control does, and returns its rows.

    Without a reality gap, an evaluation on the robot is a simulation with the true failure. The
    search begins from the gait before the failure and random controllers, as a repair does.
    """
    given = _given(cell, needs)
    simulator = Simulator(given.robot, threads=1)
    before = _displacement(simulator, given)
    rows: list[EvolutionRow] = []

    def keep(generation: Generation) -> None:
        if math.isfinite(generation.best):
            rows.append(
                EvolutionRow(
                    robot=given.robot.name,
                    case=cell.parameters["case"],
                    seed=cell.seed,
                    evaluations=generation.evaluations,
                    before=before,
                    best=float(generation.best),
                )
            )

    # A stream that no repair of the recovery draws from: the control is an independent search.
    stream = repair_stream(cell.seed, given.settings.trials + 1)
    assumed = partial(assumed_uncertainty, given.robot)
    RepairSearch(simulator, given.settings)([given.truth], assumed, [given.gait], stream, keep)
    return {"evolution": as_dicts(rows)}


def _displacement(simulator: Simulator, given: _Given) -> float:
    """Returns the forward displacement before the failure, m."""
    walk = simulator.run([(INTACT, given.gait)], given.settings.steps, DISPLACEMENT.record)
    return float(DISPLACEMENT.of(given.robot, INTACT, walk.behaviour)[0])
