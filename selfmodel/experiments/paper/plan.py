"""Definition of the paper's experiment, as cells of a grid."""

import dataclasses
import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from selfmodel.arguments import AUTO, comparator_choice
from selfmodel.comparators import FORWARD_DISPLACEMENT
from selfmodel.errors import InputError, unknown_name
from selfmodel.experiments.grid import Cell, check_runs
from selfmodel.experiments.paper.reported import FAILURES
from selfmodel.experiments.study.gaits import gait_cell
from selfmodel.experiments.study.planned_robots import planned
from selfmodel.settings import Settings
from selfmodel.tasks import ROBOTS

COMPARATORS = (FORWARD_DISPLACEMENT.name, AUTO)
"""Comparators by default: the paper's, then selfmodel's."""

ON_ROBOT = "evolution-on-robot"
"""Name of the part of a run that is the paper's control: the repair EA on the damaged robot."""

RECOVER = "selfmodel.experiments.paper.work:recover"
EVOLVE = "selfmodel.experiments.paper.work:evolve_on_robot"
"""Functions of the cells."""


@dataclass(frozen=True)
class PaperStudy:
    """Definition of the experiment: robots, failures, comparators and the search budget.

    Attributes:
        folder: Folder of the gaits, runs, tables and figures.
        robots: Names of the paper's robots.
        cases: Numbers of failures in Table I.
        seeds: Seeds, one run of each case each.
        comparators: Names of comparators, ``package.module:object``, or ``auto``.
        settings: Parameters of the recoveries.
    """

    folder: Path
    robots: Sequence[str] = tuple(ROBOTS)
    cases: Sequence[int] = tuple(FAILURES)
    seeds: Sequence[int] = range(1)
    comparators: Sequence[str] = COMPARATORS
    settings: Settings = field(default_factory=Settings)


def check(study: PaperStudy) -> None:
    """Checks the definition of an experiment, before anything is run.

    Raises:
        InputError: The definition is invalid.
    """
    for robot in study.robots:
        if robot not in ROBOTS:
            raise unknown_name("robot of the paper", robot, ROBOTS)
    for case in study.cases:
        if case not in FAILURES:
            raise unknown_name("case of Table I", str(case), map(str, FAILURES))
    for comparator in study.comparators:
        if comparator == ON_ROBOT:
            raise InputError(f"{ON_ROBOT} is no comparator: it is run in addition to any of them")
        comparator_choice(comparator)


def cells(study: PaperStudy) -> list[Cell]:
    """Returns the cells of the runs, one seed after another, with the gaits that they need.

    A run has a recovery with each comparator, and the paper's control.

    Raises:
        InputError: The experiment is invalid, or its folder contains another.
    """
    check(study)
    shared = {"settings": dataclasses.asdict(study.settings)}
    planned_robots = {robot: planned(robot) for robot in study.robots}
    found = []
    for seed, robot in itertools.product(study.seeds, study.robots):
        gait = gait_cell(planned_robots[robot], study.settings, seed)
        for case in study.cases:
            key = f"{robot}-case{case:02d}-seed{seed:03d}"
            truth = ROBOTS[robot].cases[case]
            parameters = {**planned_robots[robot], "case": case, "truth": truth, "shared": shared}
            found += [
                Cell(function, key, parameters, seed, part, needs={"gait": gait})
                for function, part in (
                    *((RECOVER, comparator) for comparator in study.comparators),
                    (EVOLVE, ON_ROBOT),
                )
            ]
    check_runs(study.folder, found, "the paper's experiment")
    return found
