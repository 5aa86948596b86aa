"""Definition of a study of baselines, as jobs of two grids: repertoires, then cells."""

import dataclasses
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from selfmodel.errors import InputError, unknown_name
from selfmodel.experiments import robots
from selfmodel.experiments.grid import Job, check_shared, finished
from selfmodel.experiments.study_files import check_keys, key_of
from selfmodel.physical.reality_gap import MAX_GAP_LEVEL
from selfmodel.recovery.baselines.problem import BaselineSettings
from selfmodel.recovery.baselines.registry import BASELINES, ORACLE
from selfmodel.recovery.repertoire.model_digest import model_digest
from selfmodel.version import __version__

ORACLE_TRIALS = 6
"""Physical trials whose mean is the value of the oracle."""

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
        InputError: The definition is invalid, or its folder contains another study.
    """
    check_keys(study.robots)
    for method in study.methods:
        if method not in BASELINES:
            raise unknown_name("baseline", method, BASELINES)
    for name in study.robots:
        cases = robots.robot_entry(name).cases
        for case in study.cases:
            if case not in cases:
                raise unknown_name(f"case of {name}", str(case), map(str, cases))
    for gap in study.gaps:
        if not 0 <= gap <= MAX_GAP_LEVEL:
            raise InputError(f"expected a gap from 0 to {MAX_GAP_LEVEL}, such as 0.1, got {gap}")
    check_shared(study.folder, _shared(study), "a study of baselines")


def repertoire_jobs(study: BaselineStudy) -> list[Job]:
    """Returns the jobs that make the repertoires, one per robot; none if no method needs them."""
    if WITH_REPERTOIRE not in study.methods:
        return []
    return [
        Job(
            key=key_of(name),
            parameters={
                **_robot(name),
                "steps": study.steps,
                "evaluations": study.repertoire_evaluations,
            },
            seed=0,
            parts=("repertoire",),
        )
        for name in study.robots
    ]


def repertoire_path(folder: Path, robot: str) -> Path:
    """Returns the file of a robot's repertoire in the folder of a study."""
    return folder / "repertoires" / f"{key_of(robot)}.npz"


def cell_jobs(study: BaselineStudy, only: tuple[int, int] = (1, 1)) -> list[Job]:
    """Returns the jobs of the cells: robot x case x gap x seed, each with a part per method.

    Args:
        study: The study.
        only: ``(i, n)``: share i of n of the cells, from 1.
    """
    made = {part.key for part in finished(study.folder / "repertoires")}
    part, parts = only
    jobs = []
    for seed in study.seeds:
        for name in study.robots:
            entry = robots.robot_entry(name)
            methods = [
                method
                for method in study.methods
                if method != WITH_REPERTOIRE or key_of(name) in made
            ]
            jobs += [
                Job(
                    key=f"{key_of(name)}-case{case:02d}-gap{gap:g}-seed{seed:03d}",
                    parameters={
                        **_robot(name),
                        "case": case,
                        "truth": entry.cases[case],
                        "gap": gap,
                        "shared": _shared(study),
                    },
                    seed=seed,
                    parts=tuple(methods),
                )
                for case in study.cases
                for gap in study.gaps
            ]
    return jobs[part - 1 :: parts]


def settings_of(shared: dict[str, Any], method: str) -> BaselineSettings:
    """Returns the sizes of a method, with its own number of physical trials."""
    settings = BaselineSettings(**shared["settings"])
    own = {ORACLE: ORACLE_TRIALS, MANY_TRIALS: shared["evolution_trials"]}
    return dataclasses.replace(settings, trials=own.get(method, settings.trials))


def _robot(name: str) -> dict[str, Any]:
    return {"robot": name, "model": model_digest(robots.robot_entry(name).robot())}


def _shared(study: BaselineStudy) -> dict[str, Any]:
    """Returns the parameters that all cells of one results table share."""
    return {
        "selfmodel": __version__,
        "steps": study.steps,
        "settings": dataclasses.asdict(study.settings),
        "evolution_trials": study.evolution_trials,
        "repertoire_evaluations": study.repertoire_evaluations,
    }


def method_key(method: str) -> int:
    """Returns the key of a method's random number stream, which depends on its name alone."""
    return int.from_bytes(hashlib.sha256(method.encode()).digest()[:4])
