"""The options of the commands that run and compare studies; see ``commands``."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from selfmodel.cli.options import (
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
    RepairName,
    Scheduler,
    Seeds,
    Steps,
    StudyFolder,
    StudyScore,
    StudySearch,
    Trials,
    Workers,
)

FORMAT_NAMES = ("csv", "parquet", "latex", "markdown")
TableFormat = Annotated[
    str | None,
    typer.Option(
        "--table",
        "--table-format",
        metavar="|".join(FORMAT_NAMES),
        help=f"Write the tables in this format too ({', '.join(FORMAT_NAMES)}), into the folder "
        "tables of the study.",
        rich_help_panel=STUDY,
    ),
]


@dataclass(frozen=True, kw_only=True)
class Ablate:
    """Compare comparators on the same trials: robots x cases x gaps x seeds.

    The results are the rates of correct diagnoses, with 95 % intervals. An interrupted ablation
    is continued by the same command.
    """

    out: StudyFolder
    robots: Annotated[
        str, typer.Option(metavar="A,B|all", help="Robots.", rich_help_panel=STUDY)
    ] = "all"
    cases: Cases = "all"
    damages: Damages = ""
    kinds: KindNames = DEFAULT_KIND_NAMES
    comparators: ComparatorNames = "all"
    gaps: GapLevels = "0"
    seeds: Seeds = 1
    seed: FirstSeed = 0
    next_trial: Annotated[
        str,
        typer.Option(
            metavar="WAY",
            help="Choice of the trials' controllers: bank, the same gaits for all comparators; or "
            "repair or disagreement, as in `selfmodel recover`.",
            rich_help_panel=CONTROLLER,
        ),
    ] = "bank"
    repair: RepairName = "paper"
    search: StudySearch = None
    score: StudyScore = None
    steps: Steps = 1000
    trials: Annotated[
        int,
        typer.Option(
            min=1,
            max=99,
            metavar="N",
            help="Physical trials of the damaged robot.",
            rich_help_panel=CONTROLLER,
        ),
    ] = 3
    bank: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Folder of gaits, ROBOT-0.npz to ROBOT-5.npz.",
            show_default="evolved",
            rich_help_panel=CONTROLLER,
        ),
    ] = None
    population: Population = 100
    generations: Generations = 30
    workers: Workers = 0
    executor: ExecutorName = "processes"
    scheduler: Scheduler = None
    only: Only = "1/1"
    table: TableFormat = None
    as_json: Json = False


@dataclass(frozen=True, kw_only=True)
class ListSuite:
    """List the domains with their tasks, cases, joints, sensors, motors and time steps."""

    as_json: Json = False


@dataclass(frozen=True, kw_only=True)
class RunSuite:
    """Fail and recover bodies of the suite, selfmodel's and your own: bodies x cases x seeds.

    An interrupted study is continued by the same command.
    """

    out: StudyFolder
    domains: Annotated[
        str,
        typer.Option(
            metavar="A,B|all",
            help="Domains that `selfmodel suite list` lists, or MJCF and URDF files.",
            rich_help_panel=STUDY,
        ),
    ] = "all"
    tasks: Annotated[
        str | None,
        typer.Option(
            metavar="A,B|all",
            help="Tasks of the domains.",
            show_default="the first of each domain",
            rich_help_panel=STUDY,
        ),
    ] = None
    cases: Cases = "all"
    seeds: Seeds = 1
    seed: FirstSeed = 0
    only: Only = "1/1"
    gap: GapLevel = 0.0
    repair: RepairName = "paper"
    search: StudySearch = None
    score: StudyScore = None
    controller: ControllerKind = "network"
    neurons: Neurons = None
    comparator: ComparatorName = "segment-prediction"
    kinds: KindNames = PAPER_KIND_NAMES
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
    ] = None
    population: Population = 100
    generations: Generations = 30
    trials: Trials = 3
    workers: Workers = 0
    executor: ExecutorName = "processes"
    scheduler: Scheduler = None
    table: TableFormat = None
    as_json: Json = False


@dataclass(frozen=True, kw_only=True)
class RepeatPaper:
    """Repeat the paper's experiment: its tables and figures, as PNG, PDF, CSV and Markdown.

    Each case is recovered with each comparator, and by evolution on the robot, the paper's
    control. An interrupted experiment is continued by the same command.
    """

    out: StudyFolder
    robots: Annotated[
        str,
        typer.Option(metavar="A,B|all", help="The paper's robots.", rich_help_panel=STUDY),
    ] = "all"
    cases: Cases = "all"
    comparators: ComparatorNames = "forward-displacement,auto"
    seeds: Seeds = 1
    seed: FirstSeed = 0
    steps: Steps = 1000
    trials: Trials = 3
    population: Population = 100
    generations: Generations = 30
    workers: Workers = 0
    executor: ExecutorName = "processes"
    scheduler: Scheduler = None
    table: TableFormat = None
    as_json: Json = False


@dataclass(frozen=True, kw_only=True)
class Compare:
    """Compare the methods of a study by pairs: tests, intervals, marginal means, figures.

    Two methods are compared on the physical robots and trials that both had. The p values are
    corrected for the number of pairs in a table by Holm's method. Nothing is run.
    """

    study: Annotated[
        Path,
        typer.Argument(
            metavar="STUDY",
            help="Folder of ablate, paper or suite run; or its results.csv; or the results.jsonl "
            "of other methods.",
        ),
    ]
    out: Annotated[
        Path | None,
        typer.Option(
            *("--out", "-o"),
            metavar="DIR",
            help="Folder of the tables and figures.",
            show_default="STUDY/comparison",
        ),
    ] = None
    table: Annotated[
        str,
        typer.Option(
            "--table",
            "--table-format",
            metavar="|".join(FORMAT_NAMES),
            help="Format of the tables.",
        ),
    ] = "csv"
    as_json: Json = False
