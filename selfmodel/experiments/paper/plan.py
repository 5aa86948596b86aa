"""Definition of the paper's experiment, as jobs of two grids: gaits, then recoveries."""

import dataclasses
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from selfmodel.comparators import FORWARD_DISPLACEMENT
from selfmodel.errors import InputError, unknown_name
from selfmodel.experiments.arguments import AUTO, comparator_choice
from selfmodel.experiments.gaits import check_not_evolved, gait_settings
from selfmodel.experiments.grid import Job, check_shared
from selfmodel.experiments.paper.reported import FAILURES
from selfmodel.settings import Settings
from selfmodel.tasks import ROBOTS
from selfmodel.version import __version__

COMPARATORS = (FORWARD_DISPLACEMENT.name, AUTO)
"""Comparators by default: the paper's, then selfmodel's."""

ON_ROBOT = "evolution-on-robot"
"""Name of the part of a run that is the paper's control: the repair EA on the damaged robot."""


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
        InputError: The definition is invalid, or its folder contains another experiment.
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
    check_shared(study.folder, _shared(study), "the paper's experiment")


def gait_jobs(study: PaperStudy) -> list[Job]:
    """Returns the jobs that evolve the gaits before the failure, one per robot and seed."""
    return [
        Job(
            key=f"{robot}-seed{seed:03d}",
            parameters={
                **_robot(robot),
                "selfmodel": __version__,
                "settings": gait_settings(study.settings),
            },
            seed=seed,
            parts=("gait",),
        )
        for seed in study.seeds
        for robot in study.robots
    ]


def recovery_jobs(study: PaperStudy) -> list[Job]:
    """Returns the jobs of the runs with an evolved gait, one seed after another.

    The parts of a run are a recovery with each comparator, and the paper's control.

    Raises:
        InputError: The file of an evolved gait is missing.
    """
    found = []
    for gait in gait_jobs(study):
        path = gait_path(study.folder, gait.key)
        if not path.exists():
            check_not_evolved(path)
            continue
        robot = gait.parameters["robot"]
        found += [
            Job(
                key=f"{robot}-case{case:02d}-seed{gait.seed:03d}",
                parameters={
                    **_robot(robot),
                    "case": case,
                    "truth": ROBOTS[robot].cases[case],
                    "gait": gait.key,
                    "gait_sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
                    "shared": _shared(study),
                },
                seed=gait.seed,
                parts=(*study.comparators, ON_ROBOT),
            )
            for case in study.cases
        ]
    return found


def gait_path(folder: Path, key: str) -> Path:
    """Returns the file of a gait in the folder of an experiment."""
    return folder / "gaits" / f"{key}.npz"


def _robot(name: str) -> dict[str, Any]:
    model = ROBOTS[name].robot().mjcf
    return {"robot": name, "model": hashlib.sha256(model.encode()).hexdigest()}


def _shared(study: PaperStudy) -> dict[str, Any]:
    """Returns the parameters that all runs of one table share."""
    return {"selfmodel": __version__, "settings": dataclasses.asdict(study.settings)}
