"""The studies of this package: an ablation of comparators, recoveries of many bodies, the paper."""

import dataclasses
import itertools
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any
from urllib.parse import quote

from selfmodel import arguments, plugins
from selfmodel.arguments import AUTO, KindSource, comparator_choice, read_controller, robot_entry
from selfmodel.comparators import COMPARATORS, FORWARD_DISPLACEMENT, SEGMENT_PREDICTION
from selfmodel.controllers.controller import Controller
from selfmodel.diagnosis.comparator import Comparator
from selfmodel.diagnosis.losses import check_limit, check_steps, still_trial
from selfmodel.errors import (
    InputError,
    check_name,
    items_of,
    names_of,
    real_numbers,
    scalar_of,
    whole_number,
    whole_numbers,
)
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.registry import TABLE_ONE, check_cases, kind_names
from selfmodel.files import path_of
from selfmodel.recovery.recover import NextTrial
from selfmodel.recovery.repair import MakeSearch
from selfmodel.recovery.scores import TRACKING, Score
from selfmodel.settings import DIAGNOSTIC_SEARCHES, EA, STEPWISE, RepairSettings, Settings
from selfmodel.simulation.reality_gap import MAX_GAP_LEVEL
from selfmodel.studies import recoveries
from selfmodel.studies.bodies import (
    DOMAINS,
    Asked,
    bodies_of,
    failures_of,
    judged,
    known_cases,
)
from selfmodel.studies.cells import Cell
from selfmodel.studies.experiment import check_score
from selfmodel.studies.recoveries import (
    HEALTHY_TRIALS,
    ON_ROBOT,
    REASON,
    repair_parameters,
    robot_key,
)
from selfmodel.studies.study import SHARED, Point, Study
from selfmodel.tasks import ROBOTS, Entry

BANK = "bank"
NEXT_TRIAL = (BANK, *plugins.NEXT_TRIAL)
"""Choices of the controllers of an ablation's trials: gaits from the bank, the same for every
comparator; or, after the first trial, as in a recovery, by the diagnosis so far."""

GAITS = 6
"""Number of gaits per robot in the bank."""

PAPER_COMPARATORS = (FORWARD_DISPLACEMENT.name, AUTO)
"""Comparators of the paper's experiment by default: the paper's, then selfmodel's."""

GIVEN, CONTROLLER_FILES = "given", (".toml", ".npz", ".mcap")
"""In place of a design: the controller of a file; and the endings of such files."""

Needs = Callable[[Point], Mapping[str, Cell]]

Share = tuple[int, int]
"""``(i, n)``: share i of n of the runs, from 1, for n machines with a folder each."""

ALL: Share = (1, 1)

ROBOT = "names of robots or paths of their models, which each process of a study loads"
"""What is expected as the robots of a study."""


def ablation(
    folder: str | Path,
    *,
    robots: str | Path | Iterable[str | Path] = tuple(ROBOTS),
    cases: int | Iterable[int] | None = None,
    comparators: str | Comparator | Iterable[str | Comparator] = tuple(COMPARATORS),
    gaps: float | Iterable[float] = 0.0,
    seeds: int | Iterable[int] = 1,
    settings: Settings | None = None,
    damages: str | Hypothesis | Iterable[str | Hypothesis] = (),
    kinds: KindSource = "default",
    diagnostic_searches: str | Iterable[str] = STEPWISE,
    next_trial: str | NextTrial = BANK,
    bank: str | Path | None = None,
    score: str | Score | None = None,
    repair: str | None = None,
    search: str | MakeSearch | None = None,
    repair_settings: RepairSettings | None = None,
    only: Share | str = ALL,
) -> Study:
    """Returns a study in which every comparator diagnoses the same trials at equal cost.

    All comparators have the same search, and simulate as many control steps for each trial, at
    most: without a limit in the settings, those of the paper's EA, a rollout for each evaluation.

    The diagnoses of a run need its trials, which need its gaits. With other choices of the next
    trial than the bank, a recovery needs the first gait alone.

    One value may stand for a sequence of it, but for ``seeds``. The processes of a study find
    comparators, kinds and a score by name: such an object is built in, or a variable of a module
    that can be imported.

    Args:
        folder: Folder of the study.
        robots: Names of robots, or paths of MJCF or URDF files.
        cases: Numbers of failures of Table I; None for all that apply to each robot.
        comparators: Comparators, their names, or ``package.module:object``.
        gaps: Levels of the reality gap.
        seeds: Seeds, one run each; a number is a count, as of ``--seeds``: 3 for 0, 1 and 2.
        settings: Parameters of the search, None for the paper's; ``trials`` is the number of trials
            of the damaged robot.
        damages: Further failures, in notation.
        kinds: Fault kinds to search, or their names as in ``--kinds``.
        diagnostic_searches: Searches of each comparator, of ``DIAGNOSTIC_SEARCHES``.
        next_trial: One of ``NEXT_TRIAL``, a function as for ``selfmodel.recover``, or its name.
        bank: Folder of gaits, ``ROBOT-K.npz``; None to evolve them.
        score: The fitness, or its name; None for that of the repair.
        repair: Name of the repair that evolves gaits and recoveries, ``robust``, the default, or
            ``paper``.
        search: Name of its search; None for that of the repair.
        repair_settings: Parameters of the repair, in runs as long; None for ``settings``.
        only: Share of the runs, such as ``(2, 8)`` or ``2/8``.
    """
    robots, next_trial = names_of(robots, ROBOT), plugins.name_of("next_trial", next_trial)
    cases = None if cases is None else whole_numbers("cases", cases, 1)
    comparators, kinds = plugins.comparator_names(comparators), plugins.kinds_named(kinds)
    gaps, seeds = real_numbers("gaps", gaps), _seeds_of(seeds)
    damages = names_of(damages, "failures in notation", Hypothesis)
    bank = None if bank is None else path_of(bank, "a folder of gaits")
    settings, (share, shares) = arguments.settings_of(settings), share_of(only)
    # The searches are an axis: a folder may get further ones.
    _check_search(settings, Settings.diagnostic_search, "give diagnostic_searches")
    limit = settings.max_simulated_steps or settings.evaluations * settings.steps
    settings = dataclasses.replace(settings, max_simulated_steps=limit)
    searches = names_of(diagnostic_searches, "searches of a diagnosis, such as ea")
    for one in searches:
        check_name("diagnostic search", one, DIAGNOSTIC_SEARCHES)
    chosen, by_bank = repair_parameters(repair, search, score, repair_settings), next_trial == BANK
    trials = settings.trials
    lists = {"robots": robots, "comparators": comparators, "gaps": gaps, "seeds": seeds}
    lists |= {"diagnostic searches": searches}
    _check(lists, cases, damages, next_trial, trials)
    if bank is not None and by_bank and (repair, repair_settings) != (None, None):
        raise InputError(
            "with a bank and its next trials all gaits are given and nothing is evolved, got a "
            "repair or its settings: leave it or the bank out, or choose the next trial by repair"
        )
    if chosen["score"] == TRACKING and bank is None:
        raise InputError(
            f"the score {TRACKING} follows a gait, and a study without a bank evolves its gaits: "
            f"give bank= (--bank), a folder with ROBOT-K.npz, or another score"
        )
    entries = {robot: robot_entry(robot) for robot in robots}
    models = {robot: recoveries.planned(robot, entry) for robot, entry in entries.items()}
    failures = {
        robot: failures_of(robot, entry, cases, damages, kinds) for robot, entry in entries.items()
    }
    for entry in entries.values():
        check_score(chosen["score"], entry)
        still = still_trial(entry.robot(), settings.steps)
        for name in comparators:
            check_steps(plugins.comparator(name), still, entry.robot())
            check_limit(limit, comparator_choice(name), still, entry.robot())
    runs = [
        _point(models[robot], case, truth, gap, seed)
        for seed, robot in itertools.product(seeds, robots)
        for case, truth in failures[robot]
        for gap in gaps
    ][share - 1 :: shares]
    # The trials of a recovery exclude the failing one.
    own = dataclasses.replace(settings, trials=trials if by_bank else trials - 1)
    shared = {**_shared(own, kinds, chosen, next_trial), "evolves": bank is None or not by_bank}

    @cache
    def gait(robot: str, number: int) -> Cell:
        if bank is None:
            return recoveries.gait_cell(models[robot], shared, number)
        given = recoveries.bank_gait(bank, robot, number)
        return recoveries.given_gait_cell(given, models[robot], number)

    def needs(point: Point) -> dict[str, Cell]:
        robot, seed = point["robot"], point["seed"]
        if not by_bank:
            return {"gait": gait(robot, seed % GAITS)}
        count = max(HEALTHY_TRIALS, trials)
        gaits = {f"gait-{number}": gait(robot, (seed + number) % GAITS) for number in range(count)}
        methods = ("comparator", "diagnostic_search")
        run = {name: value for name, value in point.items() if name not in methods}
        function = f"{recoveries.__name__}:run_trials"
        # Of the kinds, only those of the failure determine its trials.
        parameters = {**run, SHARED: shared}
        faults = recoveries.truth_of(parameters, entries[robot].robot()).faults
        own = {fault.kind for fault in faults}
        used = (name for name in shared["kinds"].split(",") if own & {*plugins.kinds(name)})
        modules = plugins.modules_of({"kinds": ",".join(used)})
        return {"trials": Cell(function, _name(run), parameters, gaits, "trials", modules)}

    points = [
        {**run, "comparator": comparator, "diagnostic_search": one}
        for run in runs
        for comparator in comparators
        for one in searches
    ]
    function = "diagnose" if by_bank else "recover"
    return _study("ablate", folder, points, shared, needs, function=function)


def suite(
    folder: str | Path,
    *,
    bodies: str | Path | Iterable[str | Path] | None = None,
    cases: int | Iterable[int] | None = None,
    seeds: int | Iterable[int] = 1,
    settings: Settings | None = None,
    comparator: str | Comparator = SEGMENT_PREDICTION.name,
    damages: str | Hypothesis | Iterable[str | Hypothesis] = (),
    controller: str | Path | plugins.MakeDesign = "network",
    neurons: int | None = None,
    kinds: KindSource = "paper",
    gap: float = 0.0,
    score: str | Score | None = None,
    repair: str | None = None,
    search: str | MakeSearch | None = None,
    repair_settings: RepairSettings | None = None,
    only: Share | str = ALL,
) -> Study:
    """Returns a study of recoveries of many bodies with one comparator; see ``ablation``.

    Bodies are names of robots, or paths of MJCF or URDF files; by default those of all domains. A
    case or a damage that does not apply to a body or to its controllers is a row with the reason,
    of the first seed; one that applies to none is refused. The share is of bodies with their seeds.
    The comparator may be ``auto``. The controller may be that of a file, such as a policy's, with
    which each body walks and is recovered.
    """
    bodies = bodies_of(tuple(DOMAINS), None) if bodies is None else names_of(bodies, ROBOT)
    cases = known_cases(bodies) if cases is None else whole_numbers("cases", cases, 1)
    damages = names_of(damages, "failures in notation", Hypothesis)
    seeds, (gap,) = _seeds_of(seeds), real_numbers("gap", [gap])
    (comparator,), kinds = plugins.comparator_names([comparator]), plugins.kinds_named(kinds)
    settings, (share, shares) = arguments.settings_of(settings), share_of(only)
    neurons = None if neurons is None else whole_number("neurons", neurons, 3)
    entries = {body: robot_entry(body) for body in bodies}
    known = _known_gaits(controller, entries, neurons)
    controller = GIVEN if known else plugins.name_of("controller", controller)
    comparator_choice(comparator)
    plugins.kinds(kinds)
    _check_any(cases, damages)
    chosen = repair_parameters(repair, search, score, repair_settings, known=bool(known))
    models = {body: recoveries.planned(body, entry) for body, entry in entries.items()}
    check_cases(cases, "these bodies", known_cases(bodies))
    asked: list[Asked] = [*((case, "") for case in cases), *((None, one) for one in damages)]
    failures: dict[str, list[tuple[int | None, str, str]]] = {}
    for body, entry in entries.items():
        check_score(chosen["score"], entry)
        if gait := known.get(body):
            _, design, _ = plugins.repaired_around(chosen["repair"], gait.design, gait)
        else:
            design = plugins.design(controller, entry.robot(), neurons)
        failures[body] = judged(body, entry, design, asked, kinds)
    for number, damage in enumerate(damages, start=len(cases)):
        reasons = [found[number][2] for found in failures.values()]
        if reasons and all(reasons):
            raise InputError(f"no body can have {damage}: {reasons[0]}")
    points = [
        _point(models[body], case, truth, gap, seed)
        | {"comparator": comparator, **({REASON: reason} if reason else {})}
        for seed, body in list(itertools.product(seeds, bodies))[share - 1 :: shares]
        for case, truth, reason in dict.fromkeys(failures[body])
        if not reason or seed == seeds[0]
    ]
    shared = _shared(settings, kinds, chosen) | {"comparator": comparator, "gap": gap}
    shared |= {"controller": controller, "neurons": neurons}
    return _study("suite", folder, points, shared, _one_gait(models, shared, known))


def _known_gaits(
    controller: str | Path | plugins.MakeDesign, entries: Mapping[str, Entry], neurons: int | None
) -> dict[str, Controller]:
    """Returns the controller in a file for each body; none if a design is given."""
    if not isinstance(controller, str | Path) or Path(controller).suffix not in CONTROLLER_FILES:
        return {}
    path = Path(controller)
    known = {body: read_controller(path, one.robot(), neurons) for body, one in entries.items()}
    for one in known.values():
        if one.design.function:
            raise InputError(
                f"{path} has the function {one.design.function}, and the cells of a study hold "
                f"networks: give a policy with a network, or use `selfmodel recover`"
            )
    return known


def paper(
    folder: str | Path,
    *,
    robots: str | Path | Iterable[str | Path] = tuple(ROBOTS),
    cases: int | Iterable[int] = tuple(TABLE_ONE),
    seeds: int | Iterable[int] = 1,
    comparators: str | Comparator | Iterable[str | Comparator] = PAPER_COMPARATORS,
    settings: Settings | None = None,
) -> Study:
    """Returns the paper's experiment: its failures, repair and fault kinds, and no reality gap.

    A run has a recovery with each comparator, and the paper's control. Without a gap the self-model
    is exact, and is not calibrated. The sequences and ``seeds`` are as of ``ablation``.
    """
    robots, cases = names_of(robots, ROBOT), whole_numbers("cases", cases, 1)
    seeds, comparators = _seeds_of(seeds), plugins.comparator_names(comparators)
    settings = arguments.settings_of(settings)
    _check_search(settings, EA, "the paper has the EA alone")
    settings = dataclasses.replace(settings, diagnostic_search=EA)
    for robot in robots:
        check_name("robot of the paper", robot, ROBOTS)
    check_cases(cases, "Table I", TABLE_ONE)
    for comparator in comparators:
        if comparator == ON_ROBOT:
            raise InputError(f"{ON_ROBOT} is no comparator: it is run in addition to any of them")
        comparator_choice(comparator)
    chosen = repair_parameters(plugins.PAPER, None, None)
    models = {robot: recoveries.planned(robot, ROBOTS[robot]) for robot in robots}
    points = [
        {**_point(models[robot], case, ROBOTS[robot].cases[case], 0.0, seed), "comparator": way}
        for seed, robot, case in itertools.product(seeds, robots, cases)
        for way in (*comparators, ON_ROBOT)
    ]
    shared = {**_shared(settings, "paper", chosen), "calibrated": False}
    return _study("paper", folder, points, shared, _one_gait(models, shared))


def _seeds_of(source: int | Iterable[int]) -> tuple[int, ...]:
    """Returns seeds, given in a sequence, or as their number: those from 0 on."""
    if isinstance(scalar_of(source), Iterable):
        return whole_numbers("seeds", source, 0, 0)
    return tuple(range(whole_number("seeds", source, 4, 1)))


def _check_search(settings: Settings, known: str, remedy: str) -> None:
    if settings.diagnostic_search not in (known, Settings.diagnostic_search):
        raise InputError(
            f"expected settings of a study with no diagnostic_search of their own, got "
            f"{settings.diagnostic_search}: {remedy}"
        )


def _one_gait(
    models: Mapping[str, Mapping[str, str]],
    shared: Mapping[str, Any],
    known: Mapping[str, Controller] = MappingProxyType({}),
) -> Needs:
    """Returns the needs of a recovery: the known gait of its robot, or that of its seed."""

    @cache
    def gait(robot: str, seed: int) -> Cell:
        if robot in known:
            return recoveries.given_gait_cell(known[robot], models[robot], 0)
        return recoveries.gait_cell(models[robot], shared, seed)

    return lambda point: {} if REASON in point else {"gait": gait(point["robot"], point["seed"])}


def _study(
    name: str,
    folder: str | Path,
    points: Iterable[Point],
    shared: Mapping[str, Any],
    needs: Needs,
    *,
    function: str = "recover",
) -> Study:
    """Returns a study at points, which get their names."""
    named: dict[str, Point] = {}
    for point in points:
        if not 0 <= point["gap"] <= MAX_GAP_LEVEL:
            raise InputError(
                f"expected a gap from 0 to {MAX_GAP_LEVEL}, such as 0.05, got {point['gap']}"
            )
        other = named.setdefault(_name(point), point)["robot"]
        if other != point["robot"]:
            raise InputError(
                f"{other} and {point['robot']} would have the same file names: rename one of the "
                f"files"
            )
    place = path_of(folder, "the folder of a study")
    work = f"{recoveries.__name__}:{function}"

    def modules(point: Point) -> tuple[str, ...]:
        return plugins.modules_of({**shared, **point})

    return Study(name, place, work, named, shared, needs, modules=modules)


def _point(
    model: Mapping[str, str], case: int | None, truth: str, gap: float, seed: int
) -> dict[str, Any]:
    return {**model, "case": case, "truth": truth, "gap": gap, "seed": seed}


def _name(run: Point) -> str:
    """Returns the name of a run or of a point, in which a colon of a plug-in's is quoted."""
    failure = quote(run["truth"], safe="=") if run["case"] is None else f"case{run['case']:02d}"
    name = f"{robot_key(run['robot'])}-{failure}-gap{run['gap']!r}-seed{run['seed']:03d}"
    if "comparator" not in run:
        return name
    search = f"-{run['diagnostic_search']}".replace("+", "-") if "diagnostic_search" in run else ""
    return f"{name}-{quote(run['comparator'], safe='=')}{search}"


def _shared(
    settings: Settings, kinds: str, repair: Mapping[str, str], next_trial: str = "repair"
) -> dict[str, Any]:
    """Returns the parameters of all points: those of a recovery, with their defaults."""
    return {
        "settings": settings.as_json(),
        "kinds": kind_names(kinds),
        **repair,
        "next_trial": next_trial,
        "controller": "network",
        "neurons": None,
        "calibrated": True,
        "evolves": True,
    }


def _check(
    lists: Mapping[str, Sequence[Any]],
    cases: Sequence[int] | None,
    damages: Sequence[str],
    next_trial: str,
    trials: int,
) -> None:
    """Refuses the definition of an ablation that has no runs, or no trials to choose."""
    if empty := [name for name, values in lists.items() if not values]:
        raise InputError(f"expected at least one of the {empty[0]} of an ablation, got none")
    _check_any(cases, damages)
    for comparator in lists["comparators"]:
        plugins.comparator(comparator)
    if next_trial not in NEXT_TRIAL and ":" not in next_trial:
        check_name("choice of the next trial", next_trial, NEXT_TRIAL)
    if next_trial != BANK:
        plugins.next_trial(next_trial)
    if next_trial != BANK and trials < 2:
        raise InputError(
            f"expected at least 2 trials with the next trial by {next_trial}, got 1: the first "
            f"diagnosis chooses the second trial"
        )
    if next_trial == BANK and trials > GAITS and 0 in lists["gaps"]:
        raise InputError(
            f"without a gap, the same gait gives the same trial, and the bank has {GAITS} gaits: "
            f"give at most {GAITS} trials, got {trials}, or only gaps above 0"
        )


def _check_any(cases: Sequence[int] | None, damages: Sequence[str]) -> None:
    if not (cases is None or cases or damages):
        raise InputError("expected at least one case or one damage of a study, got neither")


def share_of(only: object) -> Share:
    """Returns a share, given as a pair or as the text ``i/n``, or raises ``InputError``."""
    pair = only.split("/") if isinstance(only, str) else items_of(only)
    whole = [int(str(one)) for one in pair if re.fullmatch("[0-9]{1,9}", str(one), re.ASCII)]
    if not (len(pair) == len(whole) == 2 and 1 <= whole[0] <= whole[1]):
        raise InputError(
            f"--only needs i/n, the i-th of every n runs with i from 1 to n, such as 2/8, in "
            f"Python only=(2, 8), got {only!r:.80}"
        )
    return whole[0], whole[1]
