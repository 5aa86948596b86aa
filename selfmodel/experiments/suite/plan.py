"""Definition of a study of many bodies, as jobs of two grids."""

import dataclasses
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from selfmodel import __version__
from selfmodel.errors import InputError, unknown_name
from selfmodel.experiments import plugins, robots
from selfmodel.experiments.gaits import gait_settings
from selfmodel.experiments.grid import Job, check_shared, finished
from selfmodel.experiments.study_files import check_keys, key_of
from selfmodel.faults.neuron import silent_neurons
from selfmodel.faults.notation import parse
from selfmodel.settings import Settings
from selfmodel.tasks import Entry


@dataclass(frozen=True)
class Study:
    """Definition of a study: bodies, failures and parameters of the recoveries.

    Attributes:
        bodies: Names of robots, and paths of MJCF files.
        cases: Numbers of failures like those of Table I; a case that does not apply to a body or
            to its controllers is omitted.
        seeds: Seeds, one run each.
        folder: Folder of the gaits, runs and results.
        settings: Parameters of the recoveries.
        score: Fitness of the repair EA, also reported per trial.
        controller: Name of the controller design.
        comparator: Name of the comparator, or ``package.module:object``.
    """

    bodies: Sequence[str]
    cases: Sequence[int]
    seeds: Sequence[int]
    folder: Path
    settings: Settings
    score: str
    controller: str
    comparator: str


def known_cases(bodies: Sequence[str]) -> tuple[int, ...]:
    """Returns the numbers of the cases that apply to at least one body."""
    return tuple(sorted({case for body in bodies for case in robots.robot_entry(body).cases}))


def check(study: Study) -> None:
    """Checks the definition of a study, before anything is run.

    Raises:
        InputError: The definition is invalid, or its folder contains another study.
    """
    plugins.comparator(study.comparator)
    check_keys(study.bodies)
    for body in study.bodies:
        entry = robots.robot_entry(body)
        plugins.design(study.controller, entry.robot())
        plugins.score(study.score, body, entry)
    known = known_cases(study.bodies)
    for case in study.cases:
        if case not in known:
            raise unknown_name("case of these bodies", str(case), map(str, known))
    check_shared(study.folder, _shared(study), "a study")


def gait_jobs(study: Study) -> list[Job]:
    """Returns the jobs that evolve the gaits before the failure, one per body and seed."""
    shared = _shared(study)
    return [
        Job(
            key=f"{key_of(body)}-seed{seed:03d}",
            parameters={
                **_body(body),
                "settings": gait_settings(study.settings),
                **{name: shared[name] for name in ("selfmodel", "score", "controller")},
            },
            seed=seed,
            parts=("gait",),
        )
        for seed in study.seeds
        for body in study.bodies
    ]


def recovery_jobs(study: Study) -> list[Job]:
    """Returns the jobs of the recoveries with an evolved gait, one seed after another.

    Raises:
        InputError: The file of an evolved gait is missing.
    """
    found = []
    for gait in gait_jobs(study):
        path = gait_path(study.folder, gait.key)
        if not path.exists():
            if any(part.key == gait.key for part in finished(study.folder / "gaits")):
                raise InputError(
                    f"{path} is missing, the first gait of recoveries: restore the file, or delete "
                    f"{study.folder / 'gaits' / gait.key} to evolve the gait again"
                )
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
    return max(silent, default=-1) < plugins.design(study.controller, robot).hidden


def gait_path(folder: Path, key: str) -> Path:
    """Returns the file of a gait in the folder of a study."""
    return folder / "gaits" / f"{key}.npz"


def _body(body: str) -> dict[str, Any]:
    robot = robots.robot_entry(body).robot()
    assets = hashlib.sha256()
    for name, content in sorted(robot.assets.items()):
        # Digests have one length, so that the boundaries of names and contents count.
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
    }
