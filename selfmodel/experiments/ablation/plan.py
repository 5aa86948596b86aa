"""Definition of an ablation and its runs, as jobs of a grid."""

import dataclasses
import hashlib
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

from selfmodel.errors import InputError, unknown_name
from selfmodel.experiments import plugins, robots
from selfmodel.experiments.chosen_score import check_score
from selfmodel.experiments.grid import Job, check_shared
from selfmodel.experiments.study_files import check_keys, key_of
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import DEFAULT_KINDS, notation_kinds
from selfmodel.physical.reality_gap import MAX_GAP_LEVEL
from selfmodel.recovery.scores.fitness import DISPLACEMENT
from selfmodel.settings import Settings
from selfmodel.version import __version__

NEXT_TRIAL = ("bank", "repair", "disagreement")
"""Choices of the trials' controllers: gaits from the bank, the same for every comparator; or, after
the first trial, the controller that the repair EA evolves for the diagnosis so far; or the
controller with the largest disagreement of the diagnosis so far."""

GAITS = 6
"""Number of gaits per robot in the bank."""

HEALTHY_TRIALS = 2
"""Number of trials before the failure."""


@dataclass(frozen=True)
class Ablation:
    """Definition of an ablation: comparators, robots, failures and reality gaps.

    Attributes:
        robots: Names of robots.
        cases: Numbers of failures of Table I; None for all that apply to each robot.
        comparators: Names of comparators, or ``package.module:object``.
        gaps: Levels of the reality gap.
        seeds: Seeds, one run each.
        folder: Folder of the gaits, runs and results.
        settings: Parameters of the search; ``trials`` is the number of trials of the damaged robot.
        damages: Further failures, in notation.
        kinds: Fault kinds to search, as in ``--kinds``.
        structure: Whether the physical robots have structural mismatches.
        next_trial: One of ``NEXT_TRIAL``.
        bank: Folder of gaits, ``ROBOT-K.npz``; None to evolve them.
        score: Name of the fitness of the repair EA, which evolves gaits and recoveries.
    """

    robots: Sequence[str]
    cases: Sequence[int] | None
    comparators: Sequence[str]
    gaps: Sequence[float]
    seeds: Sequence[int]
    folder: Path
    settings: Settings = Settings()  # noqa: RUF009  # a frozen dataclass
    damages: Sequence[str] = ()
    kinds: str = ",".join(kind.name for kind in DEFAULT_KINDS)
    structure: bool = False
    next_trial: str = "bank"
    bank: Path | None = None
    score: str = DISPLACEMENT.name


@dataclass(frozen=True)
class Cell:
    """One run of the grid, for all comparators.

    Attributes:
        robot: Name of the robot.
        case: Number of the failure in Table I; None for a failure that is not in it.
        truth: The failure, in notation.
        gap: Level of the reality gap.
        seed: Seed of all random numbers.
    """

    robot: str
    case: int | None
    truth: str
    gap: float
    seed: int

    def gaits(self, settings: Settings) -> list[int]:
        """Returns the numbers of the gaits in the bank, one per trial."""
        return [(self.seed + k) % GAITS for k in range(max(HEALTHY_TRIALS, settings.trials))]


@dataclass(frozen=True)
class Spec:
    """Complete specification of a run, as in its ``run.json``.

    Attributes:
        cell: The run.
        settings: Parameters of the search.
        kinds: Fault kinds to search.
        structure: Whether the physical robot has structural mismatches.
        next_trial: Choice of the trials' controllers, one of ``NEXT_TRIAL``.
        score: Name of the fitness of the repair EA.
    """

    cell: Cell
    settings: Settings
    kinds: str
    structure: bool
    next_trial: str
    score: str = DISPLACEMENT.name


def check(ablation: Ablation) -> None:
    """Checks the definition of an ablation, before anything is run.

    Raises:
        InputError: The definition is invalid, or its folder contains another ablation.
    """
    for name in ("robots", "comparators", "gaps", "seeds"):
        if not getattr(ablation, name):
            raise InputError(f"expected at least one of the {name} of an ablation, got none")
    if not (ablation.cases is None or ablation.cases or ablation.damages):
        raise InputError("expected at least one case or one damage of an ablation, got neither")
    _check_names(ablation)
    for gap in ablation.gaps:
        if not 0 <= gap <= MAX_GAP_LEVEL:
            raise InputError(f"expected a gap from 0 to {MAX_GAP_LEVEL}, such as 0.05, got {gap}")
    _check_trials(ablation)
    check_shared(ablation.folder, _shared(ablation), "an ablation")


def _check_trials(ablation: Ablation) -> None:
    trials = ablation.settings.trials
    if ablation.next_trial != "bank" and trials < 2:
        raise InputError(
            f"expected at least 2 trials with --next-trial {ablation.next_trial}, got 1: the first "
            f"diagnosis chooses the second trial"
        )
    if ablation.next_trial == "bank" and trials > GAITS and 0 in ablation.gaps:
        raise InputError(
            f"without a gap, the same gait gives the same trial, and the bank has {GAITS} gaits: "
            f"give at most {GAITS} trials, got {trials}, or only gaps above 0"
        )


def cells(ablation: Ablation, only: tuple[int, int] = (1, 1)) -> list[Cell]:
    """Returns the runs of an ablation, one seed after another.

    Args:
        ablation: The ablation.
        only: ``(i, n)``: share i of n of the runs, from 1.
    """
    found = [
        Cell(robot, case, truth, gap, seed)
        for seed, robot in itertools.product(ablation.seeds, ablation.robots)
        for case, truth in _failures(ablation, robot)
        for gap in ablation.gaps
    ]
    part, parts = only
    return found[part - 1 :: parts]


def job(ablation: Ablation, cell: Cell, gaits: Sequence[str]) -> Job:
    """Returns the job of a run.

    Args:
        ablation: The ablation.
        cell: The run.
        gaits: SHA-256 of each gait of the run.
    """
    failure = f"case{cell.case:02d}" if cell.case is not None else quote(cell.truth, safe="=")
    return Job(
        key=f"{key_of(cell.robot)}-{failure}-gap{cell.gap!r}-seed{cell.seed:03d}",
        parameters={
            "robot": cell.robot,
            "model": model_digest(cell.robot),
            "case": cell.case,
            "truth": cell.truth,
            "gap": cell.gap,
            "gaits": list(gaits),
            "shared": _shared(ablation),
        },
        seed=cell.seed,
        parts=tuple(ablation.comparators),
    )


def spec(of: Job) -> Spec:
    """Returns the specification in the job of a run."""
    parameters = of.parameters
    return Spec(
        cell=Cell(
            parameters["robot"], parameters["case"], parameters["truth"], parameters["gap"], of.seed
        ),
        settings=Settings(**parameters["shared"]["settings"]),
        kinds=parameters["shared"]["kinds"],
        structure=parameters["shared"]["structure"],
        next_trial=parameters["shared"]["next_trial"],
        score=parameters["shared"].get("score", DISPLACEMENT.name),
    )


def _failures(ablation: Ablation, robot: str) -> list[tuple[int | None, str]]:
    entry = robots.robot_entry(robot)
    anatomy = entry.robot().anatomy
    numbers = entry.cases if ablation.cases is None else ablation.cases
    cases: list[tuple[int | None, str]] = [(case, entry.cases[case]) for case in numbers]
    damages = [
        str(parse(damage, anatomy, _notation_kinds(ablation))) for damage in ablation.damages
    ]
    return cases + [(None, damage) for damage in dict.fromkeys(damages)]


def _notation_kinds(ablation: Ablation) -> tuple[FaultKind, ...]:
    """The fault kinds that notation may name, with the plug-ins to search."""
    return notation_kinds(plugins.kinds(ablation.kinds))


def model_digest(robot: str) -> str:
    """Returns the SHA-256 of a robot's MJCF."""
    return hashlib.sha256(robots.robot_entry(robot).robot().mjcf.encode()).hexdigest()


def _check_names(ablation: Ablation) -> None:
    check_keys(ablation.robots)
    for robot in ablation.robots:
        entry = robots.robot_entry(robot)
        check_score(ablation.score, entry)
        for case in ablation.cases or ():
            if case not in entry.cases:
                raise unknown_name(f"case of {robot}", str(case), map(str, entry.cases))
        anatomy = entry.robot().anatomy
        HypothesisSpace.of(plugins.kinds(ablation.kinds), anatomy)
        for damage in ablation.damages:
            parse(damage, anatomy, _notation_kinds(ablation))
    for comparator in ablation.comparators:
        plugins.comparator(comparator)
    if ablation.next_trial not in NEXT_TRIAL:
        raise unknown_name("choice of the next trial", ablation.next_trial, NEXT_TRIAL)


def _shared(ablation: Ablation) -> dict[str, Any]:
    """Returns the parameters that all runs of one results table share."""
    return {
        "selfmodel": __version__,
        "settings": dataclasses.asdict(ablation.settings),
        "kinds": ablation.kinds,
        "structure": ablation.structure,
        "next_trial": ablation.next_trial,
        # Left out by default, as in folders of earlier versions.
        **({} if ablation.score == DISPLACEMENT.name else {"score": ablation.score}),
    }
