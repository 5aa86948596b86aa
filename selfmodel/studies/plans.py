"""The studies of this package: an ablation of comparators, recoveries of many bodies, the paper."""

import dataclasses
import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any
from urllib.parse import quote

from selfmodel import arguments, plugins
from selfmodel.arguments import AUTO, KindSource, comparator_choice, is_model, robot_entry
from selfmodel.comparators import FORWARD_DISPLACEMENT
from selfmodel.diagnosis.comparator import Comparator
from selfmodel.errors import InputError, names_of, real_numbers, unknown_name, whole_numbers
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import kind_names, notation_kinds
from selfmodel.faults.sensors import silent_neurons
from selfmodel.files import path_of
from selfmodel.recovery.scores import Score
from selfmodel.settings import DIAGNOSTIC_SEARCHES, EA, STEPWISE, Settings
from selfmodel.simulation.reality_gap import MAX_GAP_LEVEL
from selfmodel.studies import recoveries
from selfmodel.studies.cells import Cell
from selfmodel.studies.experiment import check_score
from selfmodel.studies.recoveries import HEALTHY_TRIALS, ON_ROBOT, repair_parameters, robot_key
from selfmodel.studies.study import Point, Study
from selfmodel.tasks import ROBOTS, Entry, suite_bodies

BANK = "bank"
NEXT_TRIAL = (BANK, *plugins.NEXT_TRIAL)
"""Choices of the controllers of an ablation's trials: gaits from the bank, the same for every
comparator; or, after the first trial, as in a recovery, by the diagnosis so far."""

GAITS = 6
"""Number of gaits per robot in the bank."""

TABLE_ONE: Mapping[int, str] = MappingProxyType(
    {
        1: "a lower leg breaks off",
        2: "a whole leg breaks off",
        3: "a touch sensor fails",
        4: "2, and the touch sensor of another leg fails",
        5: "an angle sensor fails",
        6: "an upper-leg joint jams",
        7: "2, and the upper-leg joint of another leg jams",
        8: "7, and the angle sensor of a further leg fails",
        9: "nothing fails",
        10: "a hidden neuron fails",
    }
)
"""Failures by their number in the paper's Table I."""

DOMAINS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {name: tuple(entry.suite) for name, entry in ROBOTS.items()}
    | {f"{suite_bodies.PREFIX}{name}": tasks for name, tasks in suite_bodies.DOMAINS.items()}
)
"""Tasks of every domain, the default task first."""

PAPER_COMPARATORS = (FORWARD_DISPLACEMENT.name, AUTO)
"""Comparators of the paper's experiment by default: the paper's, then selfmodel's."""

Needs = Callable[[Point], Mapping[str, Cell]]

Share = tuple[int, int]
"""``(i, n)``: share i of n of the runs, from 1, for n machines with a folder each."""

ALL: Share = (1, 1)

ROBOT = "names of robots or paths of their models, which each process of a study loads"
"""What is expected as the robots of a study."""


def ablation(
    folder: str | Path,
    *,
    robots: str | Path | Iterable[str | Path],
    cases: int | Iterable[int] | None,
    comparators: str | Comparator | Iterable[str | Comparator],
    gaps: float | Iterable[float],
    seeds: int | Iterable[int],
    settings: Settings = Settings(),  # noqa: B008  # frozen
    damages: str | Hypothesis | Iterable[str | Hypothesis] = (),
    kinds: KindSource = "default",
    diagnostic_searches: str | Iterable[str] = STEPWISE,
    next_trial: str = BANK,
    bank: str | Path | None = None,
    score: str | Score | None = None,
    repair: str = plugins.PAPER,
    search: str | None = None,
    only: Share = ALL,
) -> Study:
    """Returns a study in which every comparator diagnoses the same trials at equal cost.

    All comparators have the same search, and simulate as many control steps for each trial, at
    most: without a limit in the settings, those of the paper's EA, a rollout for each evaluation.

    The diagnoses of a run need its trials, which need its gaits. With other choices of the next
    trial than the bank, a recovery needs the first gait alone.

    One value may stand for a sequence of it. The processes of a study find comparators, kinds and a
    score by name: such an object is built in, or a variable of a module that can be imported.

    Args:
        folder: Folder of the study.
        robots: Names of robots, or paths of MJCF or URDF files.
        cases: Numbers of failures of Table I; None for all that apply to each robot.
        comparators: Comparators, their names, or ``package.module:object``.
        gaps: Levels of the reality gap.
        seeds: Seeds, one run each.
        settings: Parameters of the search; ``trials`` is the number of trials of the damaged robot.
        damages: Further failures, in notation.
        kinds: Fault kinds to search, or their names as in ``--kinds``.
        diagnostic_searches: Searches of each comparator, of ``DIAGNOSTIC_SEARCHES``.
        next_trial: One of ``NEXT_TRIAL``.
        bank: Folder of gaits, ``ROBOT-K.npz``; None to evolve them.
        score: The fitness, or its name; None for that of the repair.
        repair: Name of the repair that evolves gaits and recoveries, ``robust`` or ``paper``.
        search: Name of its search; None for that of the repair.
        only: Share of the runs.
    """
    robots = names_of(robots, ROBOT)
    cases = None if cases is None else whole_numbers("cases", cases, 1)
    comparators, kinds = plugins.comparator_names(comparators), plugins.kinds_named(kinds)
    gaps, seeds = real_numbers("gaps", gaps), whole_numbers("seeds", seeds, 0, 0)
    damages = names_of(damages, "failures in notation", Hypothesis)
    bank = None if bank is None else path_of(bank, "a folder of gaits")
    settings = arguments.settings_of(settings)
    if settings.max_simulated_steps is None:
        limit = settings.evaluations * settings.steps
        settings = dataclasses.replace(settings, max_simulated_steps=limit)
    searches = names_of(diagnostic_searches, "searches of a diagnosis, such as ea")
    for one in searches:
        plugins.check_known("diagnostic search", one, DIAGNOSTIC_SEARCHES)
    chosen, by_bank = repair_parameters(repair, search, score), next_trial == BANK
    trials = settings.trials
    lists = {"robots": robots, "comparators": comparators, "gaps": gaps, "seeds": seeds}
    lists |= {"diagnostic searches": searches}
    _check(lists, cases, damages, next_trial, trials)
    if bank is not None and by_bank and repair != plugins.PAPER:
        raise InputError(
            f"with --bank and --next-trial bank all gaits are given and nothing is evolved, got "
            f"--repair {repair}: leave one of them out, or give --next-trial repair"
        )
    entries = {robot: robot_entry(robot) for robot in robots}
    models = {robot: recoveries.planned(robot, entry) for robot, entry in entries.items()}
    failures = {
        robot: _failures(robot, entry, cases, damages, kinds) for robot, entry in entries.items()
    }
    for entry in entries.values():
        check_score(chosen["score"], entry)
    runs = [
        _point(models[robot], case, truth, gap, seed)
        for seed, robot in itertools.product(seeds, robots)
        for case, truth in failures[robot]
        for gap in gaps
    ][only[0] - 1 :: only[1]]
    # The trials of a recovery exclude the failing one.
    own = dataclasses.replace(settings, trials=trials if by_bank else trials - 1)
    evolves = {"evolves": bank is None or not by_bank}
    shared = {**_shared(own, kinds, chosen, next_trial), **evolves}

    @cache
    def gait(robot: str, number: int) -> Cell:
        if bank is None:
            return recoveries.gait_cell(models[robot], shared, number)
        return recoveries.given_gait_cell(bank, models[robot], number)

    def needs(point: Point) -> dict[str, Cell]:
        robot, seed = point["robot"], point["seed"]
        if not by_bank:
            return {"gait": gait(robot, seed % GAITS)}
        count = max(HEALTHY_TRIALS, trials)
        gaits = {f"gait-{number}": gait(robot, (seed + number) % GAITS) for number in range(count)}
        methods = ("comparator", "diagnostic_search")
        run = {name: value for name, value in point.items() if name not in methods}
        function = f"{recoveries.__name__}:run_trials"
        return {"trials": Cell(function, _name(run), {**run, "shared": shared}, gaits, "trials")}

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
    bodies: str | Path | Iterable[str | Path],
    cases: int | Iterable[int],
    seeds: int | Iterable[int],
    settings: Settings,
    comparator: str | Comparator,
    controller: str = "network",
    neurons: int | None = None,
    kinds: KindSource = "paper",
    gap: float = 0.0,
    score: str | Score | None = None,
    repair: str = plugins.PAPER,
    search: str | None = None,
    only: Share = ALL,
) -> Study:
    """Returns a study of recoveries of many bodies with one comparator; see ``ablation``.

    Bodies are names of robots, or paths of MJCF or URDF files. A case that does not apply to a body
    or to its controllers is omitted; the share is of bodies with their seeds. The comparator may be
    ``auto``, and ``score`` is reported per trial too.
    """
    bodies, cases = names_of(bodies, ROBOT), whole_numbers("cases", cases, 1)
    seeds, (gap,) = whole_numbers("seeds", seeds, 0, 0), real_numbers("gap", [gap])
    (comparator,), kinds = plugins.comparator_names([comparator]), plugins.kinds_named(kinds)
    settings = arguments.settings_of(settings)
    comparator_choice(comparator)
    plugins.kinds(kinds)
    chosen = repair_parameters(repair, search, score)
    entries = {body: robot_entry(body) for body in bodies}
    models = {body: recoveries.planned(body, entry) for body, entry in entries.items()}
    _check_cases("case of these bodies", cases, known_cases(bodies))
    points: list[Point] = []
    for seed, body in list(itertools.product(seeds, bodies))[only[0] - 1 :: only[1]]:
        entry, robot = entries[body], entries[body].robot()
        check_score(chosen["score"], entry)
        hidden = plugins.design(controller, robot, neurons).hidden
        for case in cases:
            truth = entry.cases.get(case)
            # Controllers without hidden neurons have none that could fail.
            if truth and max(silent_neurons(parse(truth, robot.anatomy)), default=-1) < hidden:
                point = _point(models[body], case, truth, gap, seed)
                points.append({**point, "comparator": comparator})
    shared = _shared(settings, kinds, chosen) | {"comparator": comparator, "gap": gap}
    shared |= {"controller": controller, "neurons": neurons}
    return _study("suite", folder, points, shared, _one_gait(models, shared))


def paper(
    folder: str | Path,
    *,
    robots: str | Path | Iterable[str | Path] = tuple(ROBOTS),
    cases: int | Iterable[int] = tuple(TABLE_ONE),
    seeds: int | Iterable[int] = range(1),
    comparators: str | Comparator | Iterable[str | Comparator] = PAPER_COMPARATORS,
    settings: Settings = Settings(),  # noqa: B008  # frozen
) -> Study:
    """Returns the paper's experiment: its failures, repair and fault kinds, and no reality gap.

    A run has a recovery with each comparator, and the paper's control. Without a gap the self-model
    is exact, and is not calibrated. One value may stand for a sequence of it.
    """
    robots, cases = names_of(robots, ROBOT), whole_numbers("cases", cases, 1)
    seeds, comparators = whole_numbers("seeds", seeds, 0, 0), plugins.comparator_names(comparators)
    settings = dataclasses.replace(arguments.settings_of(settings), diagnostic_search=EA)
    for robot in robots:
        plugins.check_known("robot of the paper", robot, ROBOTS)
    _check_cases("case of Table I", cases, TABLE_ONE)
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


def _one_gait(models: Mapping[str, Mapping[str, str]], shared: Mapping[str, Any]) -> Needs:
    """Returns the needs of a recovery: the gait of its robot and seed."""

    @cache
    def gait(robot: str, seed: int) -> Cell:
        return recoveries.gait_cell(models[robot], shared, seed)

    return lambda point: {"gait": gait(point["robot"], point["seed"])}


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
    return Study(name, place, f"{recoveries.__name__}:{function}", named, shared, needs)


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
    if not (cases is None or cases or damages):
        raise InputError("expected at least one case or one damage of an ablation, got neither")
    for comparator in lists["comparators"]:
        plugins.comparator(comparator)
    plugins.check_known("choice of the next trial", next_trial, NEXT_TRIAL)
    if next_trial != BANK and trials < 2:
        raise InputError(
            f"expected at least 2 trials with --next-trial {next_trial}, got 1: the first "
            f"diagnosis chooses the second trial"
        )
    if next_trial == BANK and trials > GAITS and 0 in lists["gaps"]:
        raise InputError(
            f"without a gap, the same gait gives the same trial, and the bank has {GAITS} gaits: "
            f"give at most {GAITS} trials, got {trials}, or only gaps above 0"
        )


def _failures(
    robot: str, entry: Entry, cases: Sequence[int] | None, damages: Sequence[str], kinds: str
) -> list[tuple[int | None, str]]:
    """Returns the failures of a robot: the number in Table I, or None, and the notation."""
    searched, anatomy = plugins.kinds(kinds), entry.robot().anatomy
    HypothesisSpace.of(searched, anatomy)  # refuses kinds of which none applies
    _check_cases(f"case of {robot}", cases or (), entry.cases)
    numbered = [(case, entry.cases[case]) for case in (entry.cases if cases is None else cases)]
    named = [str(parse(damage, anatomy, notation_kinds(searched))) for damage in damages]
    return [*numbered, *((None, damage) for damage in dict.fromkeys(named))]


def _check_cases(what: str, cases: Sequence[int], known: Iterable[int]) -> None:
    names = list(map(str, known))
    for case in cases:
        plugins.check_known(what, str(case), names)


def known_cases(bodies: Sequence[str]) -> tuple[int, ...]:
    """Returns the numbers of the cases that apply to at least one body."""
    return tuple(sorted({case for body in bodies for case in robot_entry(body).cases}))


def bodies_of(domains: Sequence[str], tasks: Sequence[str] | None) -> tuple[str, ...]:
    """Returns the unique names of the robots of domains and tasks.

    Args:
        domains: Names in ``DOMAINS``, or paths of MJCF or URDF files. The prefix of a domain of the
            suite may be omitted unless another robot has the same name.
        tasks: Names of tasks; a domain contributes the tasks that it has. None for the default
            task of each domain.
    """
    bodies: list[str] = []
    for given in domains:
        domain = given if is_model(given) else _domain(given)
        every = DOMAINS.get(domain, ())
        chosen = every[:1] if tasks is None else [task for task in every if task in tasks]
        if every and not chosen:
            raise InputError(
                f"{domain} has none of the tasks {', '.join(tasks or ())}: it has "
                f"{', '.join(every)}"
            )
        is_body = domain in ROBOTS or not every
        bodies += [domain] if is_body else [f"{domain}-{task}" for task in chosen]
    known = tasks_of(domains)
    for task in tasks or ():
        plugins.check_known("task of these domains", task, known)
    return tuple(dict.fromkeys(bodies))


def tasks_of(domains: Sequence[str]) -> tuple[str, ...]:
    """Returns the names of the tasks of domains; see ``bodies_of``."""
    every = [DOMAINS[_domain(given)] for given in domains if not is_model(given)]
    return tuple(sorted({task for tasks in every for task in tasks}))


def _domain(given: str) -> str:
    domain = given if given in DOMAINS else f"{suite_bodies.PREFIX}{given}"
    if domain not in DOMAINS:
        raise unknown_name("domain", given, DOMAINS)
    return domain
