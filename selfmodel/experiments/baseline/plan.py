"""Definition of a study of baselines, as cells of a grid."""

import dataclasses
import hashlib
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from selfmodel import arguments
from selfmodel.errors import InputError, unknown_name
from selfmodel.experiments.grid import Cell, check_runs
from selfmodel.experiments.study.files import check_keys, key_of
from selfmodel.experiments.study.planned_robots import planned
from selfmodel.recovery.baselines.problem import BaselineSettings
from selfmodel.recovery.baselines.registry import BASELINES, ORACLE
from selfmodel.simulation.reality_gap import MAX_GAP_LEVEL

ORACLE_TRIALS = 6
"""Physical trials whose mean is the value of the oracle."""

MAKE = "selfmodel.experiments.baseline.work:make"
RUN = "selfmodel.experiments.baseline.work:run"
"""Functions of the cells."""

WITH_REPERTOIRE = "trial-and-error"
"""Name of the method that needs a repertoire."""

MANY_TRIALS = "physical-evolution"
"""Name of the method whose number of physical trials is ``evolution_trials``."""


@dataclass(frozen=True)
class BaselineStudy:
    """Definition of a study of baselines.

    Attributes:
        robots: Names of robots, and paths of MJCF or URDF files.
        cases: Numbers of failures of Table I.
        gaps: Levels of the reality gap.
        seeds: Seeds, one physical robot each.
        methods: Names of baselines.
        folder: Folder of the repertoires, runs and results.
        settings: Sizes of the baselines.
        steps: Control steps of a trial.
        evolution_trials: Physical trials of evolution on the physical robot.
        repertoire_evaluations: Evaluations of the search for a repertoire.
    """

    robots: Sequence[str]
    cases: Sequence[int]
    gaps: Sequence[float]
    seeds: Sequence[int]
    methods: Sequence[str]
    folder: Path
    settings: BaselineSettings
    steps: int = 1000
    evolution_trials: int = 500
    repertoire_evaluations: int = 60_000


def check(study: BaselineStudy) -> None:
    """Checks the definition of a study, before anything is run.

    Raises:
        InputError: The definition is invalid.
    """
    check_keys(study.robots)
    for method in study.methods:
        if method not in BASELINES:
            raise unknown_name("baseline", method, BASELINES)
    for name in study.robots:
        cases = arguments.robot_entry(name).cases
        for case in study.cases:
            if case not in cases:
                raise unknown_name(f"case of {name}", str(case), map(str, cases))
    for gap in study.gaps:
        if not 0 <= gap <= MAX_GAP_LEVEL:
            raise InputError(f"expected a gap from 0 to {MAX_GAP_LEVEL}, such as 0.1, got {gap}")


def cells(study: BaselineStudy, only: tuple[int, int] = (1, 1)) -> list[Cell]:
    """Returns a cell per robot, case, gap, seed and method, with the repertoires that they need.

    Args:
        study: The study.
        only: ``(i, n)``: share i of n of the physical robots, from 1.

    Raises:
        InputError: The study is invalid, or its folder contains another study.
    """
    check(study)
    shared = _shared(study)
    planned_robots = {name: planned(name) for name in study.robots}
    axes = itertools.product(study.seeds, study.robots, study.cases, study.gaps)
    part, parts = only
    found = []
    for seed, name, case, gap in list(axes)[part - 1 :: parts]:
        parameters = {
            **planned_robots[name],
            "case": case,
            "truth": arguments.robot_entry(name).cases[case],
            "gap": gap,
            "shared": shared,
        }
        key = f"{key_of(name)}-case{case:02d}-gap{gap:g}-seed{seed:03d}"
        repertoire = {"repertoire": _repertoire(study, planned_robots[name])}
        found += [
            Cell(
                RUN,
                key,
                parameters,
                seed,
                method,
                needs=repertoire if method == WITH_REPERTOIRE else {},
            )
            for method in study.methods
        ]
    check_runs(study.folder, found, "a study of baselines")
    return found


def _repertoire(study: BaselineStudy, robot: dict[str, str]) -> Cell:
    """Returns the cell of the repertoire of a robot."""
    sizes = {"steps": study.steps, "evaluations": study.repertoire_evaluations}
    key = key_of(robot["robot"])
    return Cell(MAKE, key, {**robot, **sizes}, 0, "repertoire", "repertoires")


def settings_of(shared: dict[str, Any], method: str) -> BaselineSettings:
    """Returns the sizes of a method, with its own number of physical trials."""
    settings = BaselineSettings(**shared["settings"])
    own = {ORACLE: ORACLE_TRIALS, MANY_TRIALS: shared["evolution_trials"]}
    return dataclasses.replace(settings, trials=own.get(method, settings.trials))


def _shared(study: BaselineStudy) -> dict[str, Any]:
    """Returns the parameters that all cells of one results table share."""
    return {
        "steps": study.steps,
        "settings": dataclasses.asdict(study.settings),
        "evolution_trials": study.evolution_trials,
        "repertoire_evaluations": study.repertoire_evaluations,
    }


def method_key(method: str) -> int:
    """Returns the key of a method's random number stream, which depends on its name alone."""
    return int.from_bytes(hashlib.sha256(method.encode()).digest()[:4])
