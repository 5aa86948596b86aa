"""Definition of a study of many bodies, as jobs of two grids."""

import dataclasses
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from selfmodel.errors import InputError, unknown_name
from selfmodel.experiments import plugins, robots
from selfmodel.experiments.arguments import comparator_choice
from selfmodel.experiments.chosen_score import check_score
from selfmodel.experiments.gaits import check_not_evolved, gait_settings
from selfmodel.experiments.grid import Job, check_shared
from selfmodel.experiments.study_files import check_keys, key_of
from selfmodel.faults.kinds.neuron import silent_neurons
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import PAPER_KINDS
from selfmodel.physical.reality_gap import MAX_GAP_LEVEL
from selfmodel.settings import Settings
from selfmodel.tasks import Entry
from selfmodel.version import __version__

GAIT_PARAMETERS = ("selfmodel", "score", "controller", "neurons")
"""Names of the parameters that affect a gait."""

OPTIONAL_PARAMETERS = ("kinds", "gap", "structure", "neurons")
"""Names of the parameters that ``run.json`` contains only if they differ from their defaults, so
that the same command reads a folder of version 0.1, which has no such parameters."""


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
        score: Fitness of the repair EA, also reported per trial.
        controller: Name of the controller design.
        comparator: Name of the comparator, ``package.module:object``, or ``auto``.
        kinds: Fault kinds to search, as in ``--kinds``.
        gap: Level of the reality gap.
        structure: Whether the physical robots have structural mismatches.
        neurons: Number of hidden neurons; None for the design's default.
    """

    bodies: Sequence[str]
    cases: Sequence[int]
    seeds: Sequence[int]
    folder: Path
    settings: Settings
    score: str
    controller: str
    comparator: str
    kinds: str = ",".join(kind.name for kind in PAPER_KINDS)
    gap: float = 0.0
    structure: bool = False
    neurons: int | None = None


def known_cases(bodies: Sequence[str]) -> tuple[int, ...]:
    """Returns the numbers of the cases that apply to at least one body."""
    return tuple(sorted({case for body in bodies for case in robots.robot_entry(body).cases}))


def check(study: Study) -> None:
    """Checks the definition of a study, before anything is run.

    Raises:
        InputError: The definition is invalid, or its folder contains another study.
    """
    comparator_choice(study.comparator)
    plugins.kinds(study.kinds)
    check_keys(study.bodies)
    for body in study.bodies:
        entry = robots.robot_entry(body)
        plugins.design(study.controller, entry.robot(), study.neurons)
        check_score(study.score, entry)
    if not 0 <= study.gap <= MAX_GAP_LEVEL:
        raise InputError(f"expected a gap from 0 to {MAX_GAP_LEVEL}, such as 0.05, got {study.gap}")
    known = known_cases(study.bodies)
    for case in study.cases:
        if case not in known:
            raise unknown_name("case of these bodies", str(case), map(str, known))
    check_shared(study.folder, _shared(study), "a study")


def gait_jobs(study: Study, only: tuple[int, int] = (1, 1)) -> list[Job]:
    """Returns the jobs that evolve the gaits before the failure, one per body and seed.

    Args:
        study: The study.
        only: ``(i, n)``: share i of n of the gaits, from 1.
    """
    shared = _shared(study)
    part, parts = only
    jobs = [
        Job(
            key=f"{key_of(body)}-seed{seed:03d}",
            parameters={
                **_body(body),
                "settings": gait_settings(study.settings),
                **{name: shared[name] for name in GAIT_PARAMETERS if name in shared},
            },
            seed=seed,
            parts=("gait",),
        )
        for seed in study.seeds
        for body in study.bodies
    ]
    return jobs[part - 1 :: parts]


def recovery_jobs(study: Study, only: tuple[int, int] = (1, 1)) -> list[Job]:
    """Returns the jobs of the recoveries with an evolved gait, one seed after another.

    Args:
        study: The study.
        only: ``(i, n)``: the recoveries of share i of n of the gaits, from 1.

    Raises:
        InputError: The file of an evolved gait is missing.
    """
    found = []
    for gait in gait_jobs(study, only):
        path = gait_path(study.folder, gait.key)
        if not path.exists():
            check_not_evolved(path)
            continue
        body = gait.parameters["body"]
        entry = robots.robot_entry(body)
        found += [
            Job(
                key=f"{key_of(body)}-case{case:02d}-seed{gait.seed:03d}",
                parameters={
                    **_body(body),
                    "case": case,
                    "truth": entry.cases[case],
                    "gait": gait.key,
                    "gait_sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
                    "shared": _shared(study),
                },
                seed=gait.seed,
                parts=("recovery",),
            )
            for case in study.cases
            if case in entry.cases and _applies(study, entry, case)
        ]
    return found


def _applies(study: Study, entry: Entry, case: int) -> bool:
    """Returns whether the study's controllers have the hidden neurons that a failure silences."""
    robot = entry.robot()
    silent = silent_neurons(parse(entry.cases[case], robot.anatomy))
    return max(silent, default=-1) < plugins.design(study.controller, robot, study.neurons).hidden


def gait_path(folder: Path, key: str) -> Path:
    """Returns the file of a gait in the folder of a study."""
    return folder / "gaits" / f"{key}.npz"


def _body(body: str) -> dict[str, Any]:
    robot = robots.robot_entry(body).robot()
    assets = hashlib.sha256()
    for name, content in sorted(robot.assets.items()):
        # Digests have a fixed length, so that names and contents cannot be confused.
        for part in (name.encode(), content):
            assets.update(hashlib.sha256(part).digest())
    return {
        "body": body,
        "robot": robot.name,
        "control_timestep": robot.control_timestep,
        "model": hashlib.sha256(robot.mjcf.encode()).hexdigest(),
        "assets": assets.hexdigest(),
    }


def _shared(study: Study) -> dict[str, Any]:
    """Returns the parameters that all runs of one results table share."""
    return {
        "selfmodel": __version__,
        "settings": dataclasses.asdict(study.settings),
        "score": study.score,
        "controller": study.controller,
        "comparator": study.comparator,
        **{
            field.name: getattr(study, field.name)
            for field in dataclasses.fields(study)
            if field.name in OPTIONAL_PARAMETERS and getattr(study, field.name) != field.default
        },
    }
