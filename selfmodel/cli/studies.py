"""Commands that run and compare studies: ``ablate``, ``suite``, ``paper`` and ``compare``."""

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Annotated, Any

import pandas as pd
import typer

from selfmodel.arguments import robot_entry
from selfmodel.cli.arguments import inputs
from selfmodel.cli.arguments.options import (
    CONTROLLER,
    DEFAULT_KIND_NAMES,
    PAPER_KIND_NAMES,
    STUDY,
    Cases,
    ComparatorName,
    ComparatorNames,
    ControllerKind,
    Damages,
    ExecutorName,
    FirstSeed,
    GapLevel,
    GapLevels,
    Generations,
    Json,
    KindNames,
    Neurons,
    Only,
    Population,
    Scheduler,
    Seeds,
    Steps,
    StudyFolder,
    Trials,
    Workers,
)
from selfmodel.cli.arguments.repair_options import RepairName, StudyScore, StudySearch
from selfmodel.cli.output.grid_display import PROCESSES, as_objects, end, run_shown
from selfmodel.cli.output.printing import print_json, print_lines, print_notes
from selfmodel.cli.output.tables import show
from selfmodel.comparators import COMPARATORS, DEFAULT
from selfmodel.faults.registry import kind_names
from selfmodel.plugins import PAPER
from selfmodel.robot.designs import network_for
from selfmodel.settings import Settings
from selfmodel.studies import figures, plans
from selfmodel.studies.comparisons import balance_warnings
from selfmodel.studies.paper import tables_of, write_results
from selfmodel.studies.rows import outcomes_of, study_rows, whole
from selfmodel.studies.statistics import Interval
from selfmodel.studies.study import Row, Study
from selfmodel.studies.tables import (
    FORMATS,
    Table,
    ablation_scores,
    as_json as json_of,
    check_format,
    results_files,
    suite_summaries,
    summary_table,
    table_files,
    write_files,
)
from selfmodel.tasks import ROBOTS

FORMAT_NAMES = "|".join(FORMATS)
DEFAULT_PAPER_COMPARATORS = ",".join(plans.PAPER_COMPARATORS)

TableFormat = Annotated[
    str | None,
    typer.Option(
        "--table",
        "--table-format",
        metavar=FORMAT_NAMES,
        help=f"Write the tables in this format too ({', '.join(FORMATS)}), into the folder tables "
        f"of the study.",
        rich_help_panel=STUDY,
    ),
]


def ablate(
    *,
    out: StudyFolder,
    robots: Annotated[
        str, typer.Option(metavar="A,B|all", help="Robots.", rich_help_panel=STUDY)
    ] = "all",
    cases: Cases = "all",
    damages: Damages = "",
    kinds: KindNames = DEFAULT_KIND_NAMES,
    comparators: ComparatorNames = "all",
    gaps: GapLevels = "0",
    seeds: Seeds = 1,
    seed: FirstSeed = 0,
    next_trial: Annotated[
        str,
        typer.Option(
            metavar="WAY",
            help="Choice of the trials' controllers: bank, the same gaits for all comparators; or "
            "repair or disagreement, as in `selfmodel recover`.",
            rich_help_panel=CONTROLLER,
        ),
    ] = plans.BANK,
    repair: RepairName = PAPER,
    search: StudySearch = None,
    score: StudyScore = None,
    steps: Steps = 1000,
    trials: Annotated[
        int,
        typer.Option(
            min=1,
            max=99,
            metavar="N",
            help="Physical trials of the damaged robot.",
            rich_help_panel=CONTROLLER,
        ),
    ] = 3,
    bank: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Folder of gaits, ROBOT-0.npz to ROBOT-5.npz.",
            show_default="evolved",
            rich_help_panel=CONTROLLER,
        ),
    ] = None,
    population: Population = 100,
    generations: Generations = 30,
    workers: Workers = 0,
    executor: ExecutorName = PROCESSES,
    scheduler: Scheduler = None,
    only: Only = "1/1",
    table: TableFormat = None,
    as_json: Json = False,
) -> None:
    """Compare comparators on the same trials: robots x cases x gaps x seeds.

    The results are the rates of correct diagnoses, with 95 % intervals. An interrupted ablation
    is continued by the same command.
    """
    check_format(table)
    cases = cases.strip()
    numbers = () if cases in ("all", "none") else inputs.whole_numbers("--case", cases, ())
    study = plans.ablation(
        out,
        robots=inputs.texts("--robots", robots, ROBOTS),
        cases=None if cases == "all" else numbers,
        damages=[damage.strip() for damage in damages.split(",") if damage.strip()],
        kinds=kind_names(kinds),
        comparators=inputs.texts("--comparator", comparators, COMPARATORS),
        gaps=inputs.numbers("--gap", gaps),
        seeds=range(seed, seed + seeds),
        settings=Settings(steps=steps, trials=trials, generations=generations).scaled(population),
        next_trial=next_trial,
        bank=bank,
        score=score,
        repair=repair,
        search=search,
        only=inputs.share("--only", only),
    )
    failed = run_shown(study, executor=executor, scheduler=scheduler, workers=workers)
    rows = study_rows(study.name, out)
    scores = ablation_scores(rows)
    ends = {one["trials"] for one in scores}
    shown = [one for one in scores if one["trials"] in (min(ends), max(ends))]
    notes = balance_warnings(whole(outcomes_of(study.name, rows)))
    _finish(
        study,
        failed,
        results_files(study.name, rows, "scores", scores) | figures_of(rows, scores),
        [_score_table(scores)],
        {"rows": rows, "scores": scores},
        table=table,
        as_json=as_json,
        shown=_score_table(shown),
        legend="With 95 % intervals; time as a multiple of the paper's comparator's.",
        notes=[f"warning: {note}" for note in notes],
    )


def figures_of(rows: Sequence[Row], scores: Sequence[Row]) -> dict[str, bytes]:
    """Returns the files of the figures of an ablation, in their folder."""
    found = figures.of_ablation(rows, scores)
    return {f"figures/{name}": data for name, data in found.items()}


def run_suite(
    *,
    out: StudyFolder,
    domains: Annotated[
        str,
        typer.Option(
            metavar="A,B|all",
            help="Domains that `selfmodel suite list` lists, or MJCF and URDF files.",
            rich_help_panel=STUDY,
        ),
    ] = "all",
    tasks: Annotated[
        str | None,
        typer.Option(
            metavar="A,B|all",
            help="Tasks of the domains.",
            show_default="the first of each domain",
            rich_help_panel=STUDY,
        ),
    ] = None,
    cases: Cases = "all",
    seeds: Seeds = 1,
    seed: FirstSeed = 0,
    only: Only = "1/1",
    gap: GapLevel = 0.0,
    repair: RepairName = PAPER,
    search: StudySearch = None,
    score: StudyScore = None,
    controller: ControllerKind = "network",
    neurons: Neurons = None,
    comparator: ComparatorName = DEFAULT.name,
    kinds: KindNames = PAPER_KIND_NAMES,
    steps: Annotated[
        int | None,
        typer.Option(
            min=2,
            max=10**6,
            metavar="N",
            help="Control steps of a trial.",
            show_default="1000, an episode of the suite",
            rich_help_panel=CONTROLLER,
        ),
    ] = None,
    population: Population = 100,
    generations: Generations = 30,
    trials: Trials = 3,
    workers: Workers = 0,
    executor: ExecutorName = PROCESSES,
    scheduler: Scheduler = None,
    table: TableFormat = None,
    as_json: Json = False,
) -> None:
    """Fail and recover bodies of the suite, selfmodel's and your own: bodies x cases x seeds.

    An interrupted study is continued by the same command.
    """
    check_format(table)
    names = inputs.texts("--domains", domains, plans.DOMAINS)
    wanted = None if tasks is None else inputs.texts("--tasks", tasks, plans.tasks_of(names))
    bodies = plans.bodies_of(names, wanted)
    # The last sample of a trial has no reward: an episode of the suite has 1000 rewards.
    length = steps if steps is not None else 1001 if score == "return" else 1000
    study = plans.suite(
        out,
        bodies=bodies,
        cases=inputs.whole_numbers("--case", cases, plans.known_cases(bodies)),
        seeds=range(seed, seed + seeds),
        settings=Settings(steps=length, trials=trials, generations=generations).scaled(population),
        score=score,
        controller=controller,
        comparator=comparator,
        kinds=kind_names(kinds),
        gap=gap,
        neurons=neurons,
        repair=repair,
        search=search,
        only=inputs.share("--only", only),
    )
    failed = run_shown(study, executor=executor, scheduler=scheduler, workers=workers)
    rows = study_rows(study.name, out)
    summaries = suite_summaries(rows)
    found = summary_table("summaries", summaries, list(map(_summary_texts, summaries)), texts=3)
    _finish(
        study,
        failed,
        results_files(study.name, rows, "summaries", summaries),
        [found],
        {"rows": rows, "summaries": summaries},
        table=table,
        as_json=as_json,
        shown=found,
        legend="Medians over the runs; right with its 95 % interval, %.",
    )


def list_bodies(*, as_json: Json = False) -> None:
    """List the domains with their tasks, cases, joints, sensors, motors and time steps."""
    found = [_domain_facts(domain) for domain in plans.DOMAINS]
    if as_json:
        print_json({"domains": found})
        return
    columns = ("domain", "tasks", "cases", "joints", "sensors", "motors", "weights", "step, s")
    rows = [
        [
            one["domain"],
            ", ".join(one["tasks"]),
            _ranges([int(number) for number in one["cases"]]),
            *(str(one[key]) for key in ("joints", "sensors", "motors", "weights")),
            f"{one['physics_timestep']:g} x {one['substeps']}",
        ]
        for one in found
    ]
    show(columns, rows, texts=3)
    print_lines(
        "Robots of the suite are called DOMAIN-TASK: `selfmodel robots NAME` lists the parts."
    )


def paper(
    *,
    out: StudyFolder,
    robots: Annotated[
        str,
        typer.Option(metavar="A,B|all", help="The paper's robots.", rich_help_panel=STUDY),
    ] = "all",
    cases: Cases = "all",
    comparators: ComparatorNames = DEFAULT_PAPER_COMPARATORS,
    seeds: Seeds = 1,
    seed: FirstSeed = 0,
    steps: Steps = 1000,
    trials: Trials = 3,
    population: Population = 100,
    generations: Generations = 30,
    workers: Workers = 0,
    executor: ExecutorName = PROCESSES,
    scheduler: Scheduler = None,
    table: TableFormat = None,
    as_json: Json = False,
) -> None:
    """Repeat the paper's experiment: its tables and figures, as PNG, PDF, CSV and Markdown.

    Each case is recovered with each comparator, and by evolution on the robot, the paper's
    control. An interrupted experiment is continued by the same command.
    """
    check_format(table)
    study = plans.paper(
        out,
        robots=inputs.texts("--robots", robots, ROBOTS),
        cases=inputs.whole_numbers("--case", cases, plans.TABLE_ONE),
        seeds=range(seed, seed + seeds),
        comparators=inputs.texts("--comparator", comparators, COMPARATORS),
        settings=Settings(steps=steps, trials=trials, generations=generations).scaled(population),
    )
    failed = run_shown(study, executor=executor, scheduler=scheduler, workers=workers)
    results, files = write_results(out)
    tables = tables_of(results)
    _finish(
        study,
        failed,
        {},
        tables,
        results.as_dict(),
        table=table,
        as_json=as_json,
        shown=tables[1],
        legend="Medians over the runs, m; the paper: whether it reports the case as restored.",
        written=files,
    )


def _finish(
    study: Study,
    failed: Sequence[Any],
    results: Mapping[str, bytes],
    tables: Sequence[Table],
    facts: Mapping[str, Any],
    *,
    table: str | None,
    as_json: bool,
    shown: Table,
    legend: str,
    notes: Sequence[str] = (),
    written: Sequence[Path] = (),
) -> None:
    """Writes the results of a study, prints them, and ends the command.

    Args:
        study: The study.
        failed: Its failed cells.
        results: Content of its files by path in its folder.
        tables: Its tables, for the chosen format.
        facts: What ``--json`` prints.
        table: Format of the tables; None for no files.
        as_json: Whether one JSON object is printed.
        shown: The table for readers.
        legend: Line below it.
        notes: Lines on standard error.
        written: Files that were written before.
    """
    paths = [*written, *write_files(study.folder, results)]
    if table is not None:
        paths += write_files(study.folder / "tables", table_files(tables, table))
    files = [str(path) for path in paths]
    if as_json:
        print_json(json_of({**facts, "failures": as_objects(failed), "files": files}), indent=1)
    else:
        if len(shown.shown):
            _show(shown.shown, shown.texts)
            print_lines(legend)
        print_notes(*notes)
        print_lines(*files)
    end(failed)


def _show(frame: pd.DataFrame, texts: int) -> None:
    show(list(frame.columns), frame.to_numpy().tolist(), texts=texts)


def _score_table(scores: Sequence[Row]) -> Table:
    has_recovery = any(one["recovery"] for one in scores)
    texts = [
        {
            "robot": one["robot"],
            "gap": f"{one['gap']:g}",
            "comparator": one["comparator"],
            "trials": str(one["trials"]),
            "right": f"{one['right']} of {one['runs']}",
            "right, %": _interval(one["correct"], 100, "{:.0f}"),
            "time": _interval(one["time"]),
            **({"recovered ÷ before": _interval(one["recovery"])} if has_recovery else {}),
        }
        for one in scores
    ]
    return summary_table("scores", scores, texts, texts=3)


def _summary_texts(one: Row) -> dict[str, str]:
    share = one["correct"]
    ends = f"({100 * share.low:.0f} to {100 * share.high:.0f})"
    return {
        "robot": one["robot"],
        "case": "single faults" if one["case"] is None else str(one["case"]),
        "truth": one["truth"],
        "right": f"{one['right']} of {one['runs']} {ends}",
        **{name: f"{one[name]:.2f}" for name in ("before", "after", "recovered")},
        "recovered ÷ before": "-" if one["recovery"] is None else f"{one['recovery']:.2f}",
        "upright": f"{one['upright']} of {one['runs']}",
        **{name: f"{one[name]:.0f}" for name in ("trials", "seconds")},
    }


def _domain_facts(domain: str) -> dict[str, Any]:
    entry = robot_entry(plans.bodies_of([domain], None)[0])
    robot = entry.robot()
    return {
        "domain": domain,
        "tasks": list(plans.DOMAINS[domain]),
        "robots": list(plans.bodies_of([domain], plans.DOMAINS[domain])),
        "joints": len(robot.anatomy.joints),
        "hinges": len(robot.anatomy.hinges),
        "sensors": len(robot.anatomy.sensors),
        "motors": len(robot.anatomy.motors),
        "weights": network_for(robot).weights,
        "physics_timestep": float(robot.model.opt.timestep),
        "substeps": robot.substeps,
        "control_timestep": robot.control_timestep,
        "cases": {str(number): notation for number, notation in entry.cases.items()},
    }


def _ranges(numbers: list[int]) -> str:
    """Returns ascending numbers as text, with three or more consecutive ones as ``1 to 3``."""
    runs = groupby(enumerate(numbers), key=lambda item: item[1] - item[0])
    found = [[number for _, number in run] for _, run in runs]
    return ", ".join(
        f"{run[0]} to {run[-1]}" if len(run) > 2 else ", ".join(map(str, run)) for run in found
    )


def _interval(interval: Interval | None, factor: float = 1, form: str = "{:.2f}") -> str:
    if interval is None:
        return "-"
    text: Callable[[float], str] = lambda value: form.format(factor * value)  # noqa: E731
    if math.isnan(interval.low) or math.isnan(interval.high):
        return text(interval.estimate)
    return f"{text(interval.estimate)} ({text(interval.low)} to {text(interval.high)})"
