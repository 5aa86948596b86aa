"""What a study of many bodies consists of, as the runs of a grid."""

import dataclasses
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from selfmodel.errors import InputError, unknown_name
from selfmodel.experiments import plugins, robots
from selfmodel.experiments.grid import Job, check_shared, finished
from selfmodel.experiments.keys import check_keys, key_of
from selfmodel.faults.neuron import silent_neurons
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import PAPER_KINDS
from selfmodel.physical.reality_gap import MAX_GAP_LEVEL
from selfmodel.settings import Settings
from selfmodel.tasks import Entry
from selfmodel.version import __version__

OF_DIAGNOSIS = ("trials", "genes", "kept")
"""Settings that no gait depends on."""

OF_GAIT = ("selfmodel", "score", "controller", "neurons")
"""Parameters that gaits depend on."""

LATER = ("kinds", "gap", "structure", "neurons")
"""Parameters that are kept only if they differ from their defaults, so that studies from before
they existed are continued."""


@dataclass(frozen=True)
class Study:
    """Which bodies fail in which ways, and how they are brought back.

    Attributes:
        bodies: Names of robots, and paths of MJCF files.
        cases: Numbers of failures like those of Table I; a body that cannot have one is left out of
            it, and so are silent neurons where there are none.
        seeds: A run for each.
        folder: Where all of it is kept.
        settings: The paper's numbers.
        score: What controllers are evolved for, and what is told of the trials.
        controller: The kind of controller.
        comparator: Its name, or ``package.module:object``.
        kinds: Fault kinds that are searched, as ``--kinds`` has them.
        gap: Level of the reality gap.
        structure: Whether the physical robots have structural mismatch.
        neurons: Hidden neurons of the network; the design's default for None.
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
    """Returns the numbers of the cases that at least one of some bodies has."""
    return tuple(sorted({case for body in bodies for case in robots.robot_entry(body).cases}))


def check(study: Study) -> None:
    """Checks all that can be wrong with a study, before anything is run.

    Raises:
        InputError: Something is, and which.
    """
    plugins.comparator(study.comparator)
    plugins.kinds(study.kinds)
    check_keys(study.bodies)
    for body in study.bodies:
        entry = robots.robot_entry(body)
        plugins.design(study.controller, entry.robot(), study.neurons)
        plugins.score(study.score, body, entry)
    if not 0 <= study.gap <= MAX_GAP_LEVEL:
        raise InputError(
            f"a gap is a number from 0 to {MAX_GAP_LEVEL}, such as 0.05, got {study.gap}"
        )
    known = known_cases(study.bodies)
    for case in study.cases:
        if case not in known:
            raise unknown_name("case of these bodies", str(case), map(str, known))
    check_shared(study.folder, _shared(study), "a study")


def gait_jobs(study: Study, only: tuple[int, int] = (1, 1)) -> list[Job]:
    """Returns the evolution of each body's gait before it fails, one a seed.

    Args:
        study: What to run.
        only: ``(i, n)``: every n-th gait, from the i-th, counted from 1.
    """
    shared = _shared(study)
    made_of = {name: shared["settings"][name] for name in shared["settings"]}
    for name in OF_DIAGNOSIS:
        del made_of[name]
    part, parts = only
    jobs = [
        Job(
            key=f"{key_of(body)}-seed{seed:03d}",
            parameters={
                **_body(body),
                "settings": made_of,
                **{name: shared[name] for name in OF_GAIT if name in shared},
            },
            seed=seed,
            parts=("gait",),
        )
        for seed in study.seeds
        for body in study.bodies
    ]
    return jobs[part - 1 :: parts]


def recovery_jobs(study: Study, only: tuple[int, int] = (1, 1)) -> list[Job]:
    """Returns the recoveries whose gait has been evolved, one seed after another.

    Args:
        study: What to run.
        only: Those of every n-th gait; see ``gait_jobs``.

    Raises:
        InputError: A gait that was evolved is not there any more.
    """
    found = []
    for gait in gait_jobs(study, only):
        path = gait_path(study.folder, gait.key)
        if not path.exists():
            if any(part.key == gait.key for part in finished(study.folder / "gaits")):
                raise InputError(
                    f"{path} is missing, the gait that recoveries begin with: put it back, or "
                    f"delete {study.folder / 'gaits' / gait.key} to evolve it again"
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
            if case in entry.cases and _means_something(study, entry, case)
        ]
    return found


def _means_something(study: Study, entry: Entry, case: int) -> bool:
    """Returns whether the study's controllers have the hidden neurons that a failure silences."""
    robot = entry.robot()
    silent = silent_neurons(parse(entry.cases[case], robot.anatomy))
    return max(silent, default=-1) < plugins.design(study.controller, robot, study.neurons).hidden


def gait_path(folder: Path, key: str) -> Path:
    """Returns where the gait of that key is, in the folder of a study."""
    return folder / "gaits" / f"{key}.npz"


def _body(body: str) -> dict[str, Any]:
    robot = robots.robot_entry(body).robot()
    assets = hashlib.sha256()
    for name, content in sorted(robot.assets.items()):
        # Of one length each: what ends where is told apart.
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
    """What is the same for all runs, and must be for their rows to stand in one table."""
    return {
        "selfmodel": __version__,
        "settings": dataclasses.asdict(study.settings),
        "score": study.score,
        "controller": study.controller,
        "comparator": study.comparator,
        **{
            field.name: getattr(study, field.name)
            for field in dataclasses.fields(study)
            if field.name in LATER and getattr(study, field.name) != field.default
        },
    }
