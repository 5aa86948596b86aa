"""What an ablation consists of, as the runs of a grid."""

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
from selfmodel.experiments.grid import Job, check_shared
from selfmodel.experiments.keys import check_keys, key_of
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import PAPER_KINDS, notation_kinds
from selfmodel.physical.reality_gap import MAX_GAP_LEVEL
from selfmodel.settings import Settings
from selfmodel.version import __version__

NEXT_TRIAL = ("bank", "repair", "disagreement")
"""How the controllers of the trials are chosen: gaits from the bank, the same for every comparator;
or, after the first trial, what the repair EA evolves for the diagnosis so far; or what the
hypotheses of the diagnosis so far disagree on most."""

GAITS = 6
"""Gaits of a robot in the bank."""

HEALTHY_TRIALS = 2
"""Trials before the failure."""


@dataclass(frozen=True)
class Ablation:
    """What to compare, and on what.

    Attributes:
        robots: Names of robots.
        cases: Numbers of failures of Table I; None for all that each robot can have.
        comparators: Names, or ``package.module:object``.
        gaps: Levels of the reality gap.
        seeds: A run for each.
        folder: Where all of it is kept.
        settings: The paper's numbers; ``trials`` is how many trials of the damaged robot there are.
        damages: Further failures, in notation.
        kinds: What a diagnosis considers, as ``--kinds`` takes it.
        structure: Whether the robots are built differently from their models.
        next_trial: One of ``NEXT_TRIAL``.
        bank: A folder of gaits, ``ROBOT-K.npz``; without one they are evolved.
    """

    robots: Sequence[str]
    cases: Sequence[int] | None
    comparators: Sequence[str]
    gaps: Sequence[float]
    seeds: Sequence[int]
    folder: Path
    settings: Settings = Settings()  # noqa: RUF009  # it is frozen
    damages: Sequence[str] = ()
    kinds: str = ",".join(kind.name for kind in PAPER_KINDS)
    structure: bool = False
    next_trial: str = "bank"
    bank: Path | None = None


@dataclass(frozen=True)
class Cell:
    """One run of the grid, but for its comparators.

    Attributes:
        robot: The robot's name.
        case: The failure's number in Table I, if it has one.
        truth: The failure, in notation.
        gap: The level of the reality gap.
        seed: Every random choice comes from it.
    """

    robot: str
    case: int | None
    truth: str
    gap: float
    seed: int

    def gaits(self, settings: Settings) -> list[int]:
        """Returns the numbers in the bank of the gaits of its trials, in their order."""
        return [(self.seed + k) % GAITS for k in range(max(HEALTHY_TRIALS, settings.trials))]


@dataclass(frozen=True)
class Spec:
    """All that a run needs to know, as its folder says it.

    Attributes:
        cell: Which run it is.
        settings: The paper's numbers.
        kinds: What a diagnosis considers.
        structure: Whether the robot is built differently from its model.
        next_trial: How the trials' controllers are chosen.
    """

    cell: Cell
    settings: Settings
    kinds: str
    structure: bool
    next_trial: str


def check(ablation: Ablation) -> None:
    """Checks all that can be wrong with an ablation, before anything is run.

    Raises:
        InputError: Something is, and which.
    """
    for name in ("robots", "comparators", "gaps", "seeds"):
        if not getattr(ablation, name):
            raise InputError(f"an ablation needs at least one of its {name}, got none")
    if not (ablation.cases is None or ablation.cases or ablation.damages):
        raise InputError("an ablation needs at least one case or one damage, got neither")
    _check_names(ablation)
    for gap in ablation.gaps:
        if not 0 <= gap <= MAX_GAP_LEVEL:
            raise InputError(
                f"a gap is a number from 0 to {MAX_GAP_LEVEL}, such as 0.05, got {gap}"
            )
    _check_trials(ablation)
    check_shared(ablation.folder, _shared(ablation), "an ablation")


def _check_trials(ablation: Ablation) -> None:
    trials = ablation.settings.trials
    if ablation.next_trial != "bank" and trials < 2:
        raise InputError(
            f"a trial is chosen by the first diagnosis: with --next-trial {ablation.next_trial} "
            f"there are at least 2 trials, got 1"
        )
    if ablation.next_trial == "bank" and trials > GAITS and 0 in ablation.gaps:
        raise InputError(
            f"without a gap, the same gait gives the same trial, and the bank has {GAITS}: give "
            f"at most {GAITS} trials, got {trials}, or only gaps above 0"
        )


def cells(ablation: Ablation, only: tuple[int, int] = (1, 1)) -> list[Cell]:
    """Returns the runs of an ablation, one seed after another.

    Args:
        ablation: What to run.
        only: ``(i, n)``: of every n runs the i-th, from 1.
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
    """Returns a run as the grid knows it.

    Args:
        ablation: What it belongs to.
        cell: Which one.
        gaits: A digest of each gait that it takes from the bank.
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
    """Returns what a run of the grid says of itself."""
    said = of.parameters
    return Spec(
        cell=Cell(said["robot"], said["case"], said["truth"], said["gap"], of.seed),
        settings=Settings(**said["shared"]["settings"]),
        kinds=said["shared"]["kinds"],
        structure=said["shared"]["structure"],
        next_trial=said["shared"]["next_trial"],
    )


def _failures(ablation: Ablation, robot: str) -> list[tuple[int | None, str]]:
    entry = robots.robot_entry(robot)
    anatomy = entry.robot().anatomy
    numbers = entry.cases if ablation.cases is None else ablation.cases
    cases: list[tuple[int | None, str]] = [(case, entry.cases[case]) for case in numbers]
    damages = [str(parse(damage, anatomy, _named(ablation))) for damage in ablation.damages]
    return cases + [(None, damage) for damage in dict.fromkeys(damages)]


def _named(ablation: Ablation) -> tuple[FaultKind, ...]:
    """What notation may name: also a third party's kinds, where they are considered."""
    return notation_kinds(plugins.kinds(ablation.kinds))


def model_digest(robot: str) -> str:
    """Returns the digest of a robot's model, which its results depend on."""
    return hashlib.sha256(robots.robot_entry(robot).robot().mjcf.encode()).hexdigest()


def _check_names(ablation: Ablation) -> None:
    check_keys(ablation.robots)
    for robot in ablation.robots:
        entry = robots.robot_entry(robot)
        for case in ablation.cases or ():
            if case not in entry.cases:
                raise unknown_name(f"case of {robot}", str(case), map(str, entry.cases))
        anatomy = entry.robot().anatomy
        HypothesisSpace.of(plugins.kinds(ablation.kinds), anatomy)
        for damage in ablation.damages:
            parse(damage, anatomy, _named(ablation))
    for comparator in ablation.comparators:
        plugins.comparator(comparator)
    if ablation.next_trial not in NEXT_TRIAL:
        raise unknown_name("way to choose the next trial", ablation.next_trial, NEXT_TRIAL)


def _shared(ablation: Ablation) -> dict[str, Any]:
    """What is the same for all runs, and must be for their rows to stand in one table."""
    return {
        "selfmodel": __version__,
        "settings": dataclasses.asdict(ablation.settings),
        "kinds": ablation.kinds,
        "structure": ablation.structure,
        "next_trial": ablation.next_trial,
    }
