"""Definition of an ablation and its runs, as cells of a grid."""

import dataclasses
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

from selfmodel import arguments, plugins
from selfmodel.errors import InputError, unknown_name
from selfmodel.experiments.ablation import bank
from selfmodel.experiments.grid import Cell, check_runs
from selfmodel.experiments.study.files import check_keys, key_of
from selfmodel.experiments.study.gaits import gait_cell
from selfmodel.experiments.study.planned_robots import planned
from selfmodel.experiments.study.repairs import check_repair, repair_parameters, score_name
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import DEFAULT_KINDS, notation_kinds
from selfmodel.settings import Settings
from selfmodel.simulation.reality_gap import MAX_GAP_LEVEL
from selfmodel.studies.scores import check_score

BANK = "bank"
NEXT_TRIAL = (BANK, "repair", "disagreement")
"""Choices of the trials' controllers: gaits from the bank, the same for every comparator; or, after
the first trial, the controller that the repair evolves for the diagnosis so far; or the
controller with the largest disagreement of the diagnosis so far."""

TRIALS = "trials"
"""Kind and part of the cell with the trials of a run."""

RUN_TRIALS = "selfmodel.experiments.ablation.trials:run_trials"
DIAGNOSE = "selfmodel.experiments.ablation.run_one:diagnose"
RECOVER = "selfmodel.experiments.ablation.run_one:recover"
"""Functions of the cells."""

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
        next_trial: One of ``NEXT_TRIAL``.
        bank: Folder of gaits, ``ROBOT-K.npz``; None to evolve them.
        score: Name of the fitness of the repair; None for that of the repair.
        repair: Name of the repair that evolves gaits and recoveries, ``robust`` or ``paper``.
        search: Name of its search; None for that of the repair.
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
    next_trial: str = BANK
    bank: Path | None = None
    score: str | None = None
    repair: str = plugins.PAPER
    search: str | None = None


@dataclass(frozen=True)
class Run:
    """One run, for all comparators.

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


def check(ablation: Ablation) -> None:
    """Checks the definition of an ablation, before anything is run.

    Raises:
        InputError: The definition is invalid.
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
    _check_evolved(ablation)


def _check_trials(ablation: Ablation) -> None:
    trials = ablation.settings.trials
    if ablation.next_trial != BANK and trials < 2:
        raise InputError(
            f"expected at least 2 trials with --next-trial {ablation.next_trial}, got 1: the first "
            f"diagnosis chooses the second trial"
        )
    if ablation.next_trial == BANK and trials > GAITS and 0 in ablation.gaps:
        raise InputError(
            f"without a gap, the same gait gives the same trial, and the bank has {GAITS} gaits: "
            f"give at most {GAITS} trials, got {trials}, or only gaps above 0"
        )


def _check_evolved(ablation: Ablation) -> None:
    """Checks that a repair other than the default has anything to evolve."""
    given = ablation.bank is not None and ablation.next_trial == BANK
    if given and ablation.repair != plugins.PAPER:
        raise InputError(
            f"with --bank and --next-trial bank all gaits are given and nothing is evolved, got "
            f"--repair {ablation.repair}: leave one of them out, or give --next-trial repair"
        )


def runs(ablation: Ablation, only: tuple[int, int] = (1, 1)) -> list[Run]:
    """Returns the runs of an ablation, one seed after another.

    Args:
        ablation: The ablation.
        only: ``(i, n)``: share i of n of the runs, from 1.
    """
    found = [
        Run(robot, case, truth, gap, seed)
        for seed, robot in itertools.product(ablation.seeds, ablation.robots)
        for case, truth in _failures(ablation, robot)
        for gap in ablation.gaps
    ]
    part, parts = only
    return found[part - 1 :: parts]


def cells(ablation: Ablation, only: tuple[int, int] = (1, 1)) -> list[Cell]:
    """Returns a cell per run and comparator, with the cells that they need.

    The diagnoses of a run need its trials, which need its gaits; with other choices of the next
    trial than the bank, a recovery needs the first gait alone.

    Args:
        ablation: The ablation.
        only: ``(i, n)``: share i of n of the runs, from 1.

    Raises:
        InputError: The ablation is invalid, its folder contains another one, or its bank lacks a
            gait.
    """
    check(ablation)
    chosen = runs(ablation, only)
    robots_of = {name: planned(name) for name in {run.robot for run in chosen}}
    gaits = {
        (run.robot, number): _gait(ablation, robots_of[run.robot], number)
        for run in chosen
        for number in run.gaits(ablation.settings)
    }
    shared = _shared(ablation)
    found = []
    for run in chosen:
        failure = f"case{run.case:02d}" if run.case is not None else quote(run.truth, safe="=")
        key = f"{key_of(run.robot)}-{failure}-gap{run.gap!r}-seed{run.seed:03d}"
        parameters = {
            **robots_of[run.robot],
            "case": run.case,
            "truth": run.truth,
            "gap": run.gap,
            "shared": shared,
        }
        own = [gaits[run.robot, number] for number in run.gaits(ablation.settings)]
        function, needs = RECOVER, {"gait": own[0]}
        if ablation.next_trial == BANK:
            named = {f"gait-{number}": gait for number, gait in enumerate(own)}
            trials = Cell(RUN_TRIALS, key, parameters, run.seed, TRIALS, TRIALS, named)
            function, needs = DIAGNOSE, {TRIALS: trials}
        found += [
            Cell(function, key, parameters, run.seed, comparator, needs=needs)
            for comparator in ablation.comparators
        ]
    check_runs(ablation.folder, found, "an ablation")
    return found


def _gait(ablation: Ablation, robot: Mapping[str, str], number: int) -> Cell:
    """Returns the cell of a gait: evolved, or given by its file in a bank."""
    if ablation.bank is None:
        return gait_cell(
            robot,
            ablation.settings,
            number,
            score=score_name(ablation.repair, ablation.score),
            repair=ablation.repair,
            search=ablation.search,
        )
    return bank.given_gait(ablation.bank, robot, number)


def _failures(ablation: Ablation, robot: str) -> list[tuple[int | None, str]]:
    entry = arguments.robot_entry(robot)
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


def _check_names(ablation: Ablation) -> None:
    check_keys(ablation.robots)
    check_repair(ablation.repair, ablation.search)
    score = score_name(ablation.repair, ablation.score)
    for robot in ablation.robots:
        entry = arguments.robot_entry(robot)
        check_score(score, entry)
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
        "settings": dataclasses.asdict(ablation.settings),
        "kinds": ablation.kinds,
        "next_trial": ablation.next_trial,
        "bank": ablation.bank is not None,
        "score": score_name(ablation.repair, ablation.score),
        **repair_parameters(ablation.repair, ablation.search),
    }
