"""Definition of a study of many bodies, as cells of a grid."""

import dataclasses
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from selfmodel import arguments, plugins
from selfmodel.arguments import comparator_choice
from selfmodel.errors import InputError, unknown_name
from selfmodel.experiments.grid import Cell, check_runs
from selfmodel.experiments.study.files import check_keys, key_of
from selfmodel.experiments.study.gaits import gait_cell
from selfmodel.experiments.study.planned_robots import planned
from selfmodel.experiments.study.repairs import check_repair, repair_parameters, score_name
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import PAPER_KINDS
from selfmodel.faults.sensors import silent_neurons
from selfmodel.settings import Settings
from selfmodel.simulation.reality_gap import MAX_GAP_LEVEL
from selfmodel.studies.scores import check_score
from selfmodel.tasks import Entry

RECOVER = "selfmodel.experiments.suite.work:recover"
"""Function of the cells."""


@dataclass(frozen=True)
class Study:
    """Definition of a study: bodies, failures and parameters of the recoveries.

    Attributes:
        bodies: Names of robots, and paths of MJCF or URDF files.
        cases: Numbers of failures like those of Table I; a case that does not apply to a body or
            to its controllers is omitted.
        seeds: Seeds, one run each.
        folder: Folder of the gaits, runs and results.
        settings: Parameters of the recoveries.
        score: Fitness of the repair, also reported per trial; None for that of the repair.
        controller: Name of the controller design.
        comparator: Name of the comparator, ``package.module:object``, or ``auto``.
        kinds: Fault kinds to search, as in ``--kinds``.
        gap: Level of the reality gap.
        neurons: Number of hidden neurons; None for the design's default.
        repair: Name of the repair that evolves gaits and recoveries, ``robust`` or ``paper``.
        search: Name of its search; None for that of the repair.
    """

    bodies: Sequence[str]
    cases: Sequence[int]
    seeds: Sequence[int]
    folder: Path
    settings: Settings
    score: str | None
    controller: str
    comparator: str
    kinds: str = ",".join(kind.name for kind in PAPER_KINDS)
    gap: float = 0.0
    neurons: int | None = None
    repair: str = plugins.PAPER
    search: str | None = None


def known_cases(bodies: Sequence[str]) -> tuple[int, ...]:
    """Returns the numbers of the cases that apply to at least one body."""
    return tuple(sorted({case for body in bodies for case in arguments.robot_entry(body).cases}))


def check(study: Study) -> None:
    """Checks the definition of a study, before anything is run.

    Raises:
        InputError: The definition is invalid.
    """
    comparator_choice(study.comparator)
    plugins.kinds(study.kinds)
    check_repair(study.repair, study.search)
    score = score_name(study.repair, study.score)
    check_keys(study.bodies)
    for body in study.bodies:
        entry = arguments.robot_entry(body)
        plugins.design(study.controller, entry.robot(), study.neurons)
        check_score(score, entry)
    if not 0 <= study.gap <= MAX_GAP_LEVEL:
        raise InputError(f"expected a gap from 0 to {MAX_GAP_LEVEL}, such as 0.05, got {study.gap}")
    known = known_cases(study.bodies)
    for case in study.cases:
        if case not in known:
            raise unknown_name("case of these bodies", str(case), map(str, known))


def cells(study: Study, only: tuple[int, int] = (1, 1)) -> list[Cell]:
    """Returns a cell per recovery, one seed after another, with the gaits that they need.

    Args:
        study: The study.
        only: ``(i, n)``: the recoveries of share i of n of the bodies with their seeds, from 1.

    Raises:
        InputError: The study is invalid, or its folder contains another study.
    """
    check(study)
    shared = _shared(study)
    planned_bodies = {body: planned(body) for body in study.bodies}
    part, parts = only
    pairs = list(itertools.product(study.seeds, study.bodies))[part - 1 :: parts]
    found = []
    for seed, body in pairs:
        entry = arguments.robot_entry(body)
        gait = gait_cell(
            planned_bodies[body],
            study.settings,
            seed,
            score=score_name(study.repair, study.score),
            controller=study.controller,
            neurons=study.neurons,
            repair=study.repair,
            search=study.search,
        )
        found += [
            Cell(
                RECOVER,
                f"{key_of(body)}-case{case:02d}-seed{seed:03d}",
                {
                    **planned_bodies[body],
                    "case": case,
                    "truth": entry.cases[case],
                    "shared": shared,
                },
                seed,
                "recovery",
                needs={"gait": gait},
            )
            for case in study.cases
            if case in entry.cases and _applies(study, entry, case)
        ]
    check_runs(study.folder, found, "a study")
    return found


def _applies(study: Study, entry: Entry, case: int) -> bool:
    """Returns whether the study's controllers have the hidden neurons that a failure silences."""
    robot = entry.robot()
    silent = silent_neurons(parse(entry.cases[case], robot.anatomy))
    return max(silent, default=-1) < plugins.design(study.controller, robot, study.neurons).hidden


def _shared(study: Study) -> dict[str, Any]:
    """Returns the parameters that all runs of one results table share."""
    names = ("controller", "comparator", "kinds", "gap", "neurons")
    return {
        "settings": dataclasses.asdict(study.settings),
        "score": score_name(study.repair, study.score),
        **{name: getattr(study, name) for name in names},
        **repair_parameters(study.repair, study.search),
    }
