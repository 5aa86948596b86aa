"""``selfmodel suite run``: a study in which many bodies fail as in Table I, and recover."""

from typing import Annotated

import typer

from selfmodel.cli import inputs
from selfmodel.cli.options import (
    CONTROLLER,
    PAPER_KIND_NAMES,
    STUDY,
    Cases,
    ComparatorName,
    ControllerKind,
    FirstSeed,
    GapLevel,
    Generations,
    Json,
    KindNames,
    Neurons,
    Only,
    Population,
    Seeds,
    Structural,
    StudyFolder,
    Trials,
    Workers,
)
from selfmodel.cli.output import grid_display
from selfmodel.cli.output.printing import print_json, print_lines
from selfmodel.cli.output.tables import show
from selfmodel.cli.repair_options import ScoreName
from selfmodel.comparators import DEFAULT
from selfmodel.experiments.suite.bodies import DOMAINS, bodies, tasks_of
from selfmodel.experiments.suite.plan import Study, known_cases
from selfmodel.experiments.suite.results import write_results
from selfmodel.experiments.suite.rows import Summary
from selfmodel.experiments.suite.work import run_study
from selfmodel.faults.registry import kind_names
from selfmodel.settings import Settings
from selfmodel.simulation.threads import thread_count

COLUMNS = (
    *("robot", "case", "truth", "right", "before", "after", "recovered", "recovered ÷ before"),
    *("upright", "trials", "seconds"),
)


def run(
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
    structure: Structural = False,
    score: ScoreName = "displacement",
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
    as_json: Json = False,
) -> None:
    """Fail and recover bodies of the suite, selfmodel's and your own: bodies x cases x seeds.

    An interrupted study is continued by the same command.
    """
    domain_names = inputs.texts("--domains", domains, DOMAINS)
    wanted = None if tasks is None else inputs.texts("--tasks", tasks, tasks_of(domain_names))
    chosen = bodies(domain_names, wanted)
    # The last sample of a trial has no reward: an episode of the suite has 1000 rewards.
    length = steps if steps is not None else 1001 if score == "return" else 1000
    study = Study(
        bodies=chosen,
        cases=inputs.whole_numbers("--case", cases, known_cases(chosen)),
        seeds=range(seed, seed + seeds),
        folder=out,
        settings=Settings(steps=length, trials=trials, generations=generations).scaled(population),
        score=score,
        controller=controller,
        comparator=comparator,
        kinds=kind_names(kinds),
        gap=gap,
        structure=structure,
        neurons=neurons,
    )
    share = inputs.share("--only", only)
    failed = grid_display.run_shown(
        lambda on_progress: run_study(
            study, workers=thread_count(workers), on_progress=on_progress, only=share
        ),
        out,
    )
    results = write_results(out)
    grid_display.note_unverified(results.unverified, out)
    if as_json:
        found = {**results.as_dict(), "failures": grid_display.as_objects(failed)}
        print_json(found, indent=1)
    else:
        _print(results.summaries)
        print_lines(*map(str, results.files))
    grid_display.end(failed)


def _print(summaries: tuple[Summary, ...]) -> None:
    if summaries:
        show(COLUMNS, [_texts(summary) for summary in summaries], texts=3)
        print_lines("Medians over the runs; right with its 95 % interval, %.")


def _texts(summary: Summary) -> list[str]:
    share = summary.correct
    return [
        summary.robot,
        "single faults" if summary.case is None else str(summary.case),
        summary.truth,
        f"{summary.right} of {summary.runs} ({100 * share.low:.0f} to {100 * share.high:.0f})",
        *(f"{value:.2f}" for value in (summary.before, summary.after, summary.recovered)),
        "-" if summary.recovery is None else f"{summary.recovery:.2f}",
        f"{summary.upright} of {summary.runs}",
        f"{summary.trials:.0f}",
        f"{summary.seconds:.0f}",
    ]
