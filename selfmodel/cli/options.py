"""Options that several commands share, each declared once: one spelling, one help text.

An option's first long name is on the help page; its other long names are older spellings, which
keep working. Where a command takes a list of values, they are separated by commas.
"""

from pathlib import Path
from typing import Annotated

import typer

from selfmodel.faults.registry import ALL_KINDS, DEFAULT_KINDS, KIND_SETS, PAPER_KINDS
from selfmodel.trials.trial import STAGES

FAILURE = "Failure"
PHYSICAL = "Physical robot"
CONTROLLER = "Controllers and trials"
DIAGNOSIS = "Diagnosis"
SEARCH = "Search"
STUDY = "Study"

DEFAULT_KIND_NAMES = ",".join(kind.name for kind in DEFAULT_KINDS)
PAPER_KIND_NAMES = ",".join(kind.name for kind in PAPER_KINDS)

RobotName = Annotated[
    str,
    typer.Argument(
        metavar="ROBOT",
        help="Name that `selfmodel robots` lists, or path of an MJCF or URDF file.",
    ),
]
LogFile = Annotated[Path, typer.Argument(metavar="LOG", help="Trial log, NAME.mcap.")]
LogFiles = Annotated[list[Path], typer.Argument(metavar="FILE...", help="Trial logs, NAME.mcap.")]

Case = Annotated[
    int | None,
    typer.Option(
        metavar="N", help="Failure of the paper's Table I, 1 to 10.", rich_help_panel=FAILURE
    ),
]
Cases = Annotated[
    str,
    typer.Option(
        *("--case", "--cases"),
        metavar="1,7|all",
        help="Failures of the paper's Table I, by number.",
        rich_help_panel=STUDY,
    ),
]
Damage = Annotated[
    str | None,
    typer.Option(
        metavar="NOTATION",
        help="Failure in notation, such as break:front_left_knee+friction=0.4.",
        rich_help_panel=FAILURE,
    ),
]
Damages = Annotated[
    str,
    typer.Option(
        *("--damage", "--damages"),
        metavar="NOTATION,...",
        help="Further failures, in notation; with --case none, only these.",
        rich_help_panel=STUDY,
    ),
]
HypothesisText = Annotated[
    str,
    typer.Option(
        "--hypothesis",
        metavar="NOTATION",
        help="Hypothesis to simulate, such as break:front_left_knee.",
    ),
]

ModelSettings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Setting that an MJCF or URDF lacks, such as forward=-x; as in ROBOT.toml.",
    ),
]
GapLevel = Annotated[
    float,
    typer.Option(
        "--gap",
        metavar="LEVEL",
        help="Reality gap, 0 to 0.5: 0.05 is 5 % in masses and motors, and as much noise.",
        rich_help_panel=PHYSICAL,
    ),
]
GapLevels = Annotated[
    str,
    typer.Option(
        *("--gap", "--gaps"),
        metavar="0,0.05",
        help="Levels of the reality gap, 0 to 0.5.",
        rich_help_panel=PHYSICAL,
    ),
]

ControllerKind = Annotated[
    str,
    typer.Option(
        "--controller",
        metavar="network|cpg",
        help="Design that is evolved: the paper's neural network, or a central pattern generator "
        "with one oscillator per motor.",
        rich_help_panel=CONTROLLER,
    ),
]
ControllerSource = Annotated[
    Path | None,
    typer.Option(
        "--controller",
        metavar="FILE",
        help="Controller in a FILE.npz or LOG.mcap; or network or cpg, for one with random "
        "weights.",
        show_default="network",
        rich_help_panel=CONTROLLER,
    ),
]
Neurons = Annotated[
    int | None,
    typer.Option(
        min=1,
        max=100,
        metavar="N",
        help="Hidden neurons of the network.",
        show_default="3",
        rich_help_panel=CONTROLLER,
    ),
]
Steps = Annotated[
    int,
    typer.Option(
        min=2,
        max=10**6,
        metavar="N",
        help="Control steps of a trial.",
        rich_help_panel=CONTROLLER,
    ),
]
Trials = Annotated[
    int,
    typer.Option(
        min=1,
        max=99,
        metavar="N",
        help="Physical trials after the failing one.",
        rich_help_panel=CONTROLLER,
    ),
]
NextTrialName = Annotated[
    str,
    typer.Option(
        metavar="WAY",
        help="Choice of the next trial: repair, to restore the function; or disagreement, to "
        "separate indistinguishable hypotheses as long as there are any.",
        rich_help_panel=CONTROLLER,
    ),
]
StageName = Annotated[
    str,
    typer.Option(
        "--stage",
        metavar="STAGE",
        help=f"Stage of the trial: {', '.join(STAGES)}. `selfmodel diagnose` fits the self-model "
        "to trials before the failure and explains all others.",
        rich_help_panel=CONTROLLER,
    ),
]

SelfModel = Annotated[
    str | None,
    typer.Option(
        "--robot",
        metavar="ROBOT",
        help="Self-model instead of that in the logs: a robot's name, MODEL.xml or ROBOT.urdf.",
    ),
]
ComparatorName = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        help="Comparator of simulations with logged trials: auto, the best that the logs allow; a "
        "name; or package.module:object.",
        rich_help_panel=DIAGNOSIS,
    ),
]
ComparatorNames = Annotated[
    str,
    typer.Option(
        *("--comparator", "--comparators"),
        metavar="A,B|all",
        help="Comparators, by name or package.module:object.",
        rich_help_panel=STUDY,
    ),
]
Calibrated = Annotated[
    bool,
    typer.Option(
        "--calibrate/--no-calibrate",
        help="Fit the self-model to the trials before the failure, if there are any.",
        rich_help_panel=DIAGNOSIS,
    ),
]
KindNames = Annotated[
    str,
    typer.Option(
        "--kinds",
        metavar="KIND,...",
        help=f"Fault kinds to search: {', '.join(kind.name for kind in ALL_KINDS)}, "
        f"package.module:object; or their sets: {', '.join(KIND_SETS)}.",
        rich_help_panel=DIAGNOSIS,
    ),
]
NamedKinds = Annotated[
    str,
    typer.Option(
        "--kinds",
        metavar="KIND,...",
        help="Third-party fault kinds that notation may name, package.module:object, in addition "
        "to all of selfmodel's.",
        show_default=False,
    ),
]

Population = Annotated[
    int,
    typer.Option(
        min=2, max=10_000, metavar="N", help="Genomes in a generation.", rich_help_panel=SEARCH
    ),
]
LoggedPopulation = Annotated[
    int | None,
    typer.Option(
        "--population",
        min=2,
        max=10_000,
        metavar="N",
        help="Genomes in a generation.",
        show_default="that of the first log",
        rich_help_panel=SEARCH,
    ),
]
Generations = Annotated[
    int,
    typer.Option(
        min=1, max=10_000, metavar="N", help="Generations of each EA.", rich_help_panel=SEARCH
    ),
]
LoggedGenerations = Annotated[
    int | None,
    typer.Option(
        "--generations",
        min=1,
        max=10_000,
        metavar="N",
        help="Generations of the EA.",
        show_default="that of the first log",
        rich_help_panel=SEARCH,
    ),
]
Seed = Annotated[
    int,
    typer.Option(min=0, metavar="N", help="Seed of every random choice."),
]
LoggedSeed = Annotated[
    int | None,
    typer.Option(
        "--seed",
        min=0,
        metavar="N",
        help="Seed of every random choice.",
        show_default="that of the first log",
    ),
]
FirstSeed = Annotated[
    int,
    typer.Option("--seed", min=0, metavar="N", help="First of the seeds.", rich_help_panel=STUDY),
]
Seeds = Annotated[
    int,
    typer.Option(
        min=1, metavar="N", help="Runs of each combination, a seed each.", rich_help_panel=STUDY
    ),
]
Only = Annotated[
    str,
    typer.Option(
        metavar="i/n", help="Only share i of n of the runs, for n machines.", rich_help_panel=STUDY
    ),
]

Threads = Annotated[
    int,
    typer.Option(
        min=0, max=1024, metavar="N", help="Threads of the physics; 0 for one per processor."
    ),
]
Workers = Annotated[
    int,
    typer.Option(min=0, max=1024, metavar="N", help="Processes; 0 for one per processor."),
]
ExecutorName = Annotated[
    str,
    typer.Option(
        "--executor",
        metavar="processes|dask",
        help="What computes the runs: processes of this machine, or a Dask cluster.",
    ),
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        "--scheduler",
        metavar="ADDRESS",
        help="Dask's scheduler, HOST:PORT; tls://HOST:PORT for a connection that is encrypted.",
        show_default="none",
    ),
]
StudyFolder = Annotated[
    Path,
    typer.Option(
        *("--out", "-o"),
        metavar="DIR",
        help="Folder of the study; an interrupted one is continued.",
    ),
]
NewLog = Annotated[
    Path,
    typer.Option(*("--out", "-o"), metavar="NEW.mcap", help="Log to write; it must not exist."),
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]
_SCORES = (
    "Fitness of controllers: displacement; upright, the displacement until the first fall; energy, "
    "that less the work of the joints; return, the sum of the task's rewards; tracking, the error "
    "of the joints from a trajectory; or package.module:object."
)
RepairName = Annotated[
    str,
    typer.Option(
        metavar="robust|paper",
        help="Evolve controllers on rollouts with noise and with the uncertainty of the self-model;"
        " or as the paper does, in one exact simulation.",
        rich_help_panel=SEARCH,
    ),
]
SearchName = Annotated[
    str | None,
    typer.Option(
        metavar="cma-es|ea|repertoire",
        help="Search of the robust repair: CMA-ES with raced starts, the paper's EA, or CMA-ES "
        "that starts from gaits of a repertoire.",
        show_default="cma-es; ea with --repair paper; repertoire with --repertoire",
        rich_help_panel=SEARCH,
    ),
]
StudySearch = Annotated[
    str | None,
    typer.Option(
        "--search",
        metavar="cma-es|ea",
        help="Search of the robust repair: CMA-ES with raced starts, or the paper's EA.",
        show_default="cma-es; ea with --repair paper",
        rich_help_panel=SEARCH,
    ),
]
RepertoireFile = Annotated[
    Path | None,
    typer.Option(
        "--repertoire",
        metavar="FILE",
        help="Gaits of the healthy robot, made by `selfmodel repertoire make`.",
        rich_help_panel=SEARCH,
    ),
]
StudyScore = Annotated[
    str | None,
    typer.Option(
        "--score",
        metavar="NAME",
        help=_SCORES,
        show_default="displacement; upright with --repair robust",
        rich_help_panel=CONTROLLER,
    ),
]
RecoveryScore = Annotated[
    str | None,
    typer.Option(
        "--score",
        metavar="NAME",
        help=_SCORES,
        show_default="upright; displacement with --repair paper",
        rich_help_panel=CONTROLLER,
    ),
]
Reference = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="Trajectory to follow with --score tracking: LOG.mcap, or a table (.csv, .npz, "
        ".parquet) with the columns time and joints.",
        show_default="the motion of a first controller with random weights",
        rich_help_panel=CONTROLLER,
    ),
]
MaxJointSpeed = Annotated[
    float | None,
    typer.Option(
        metavar="RAD/S",
        help="With --score upright: displacement counts while no joint is faster.",
        rich_help_panel=CONTROLLER,
    ),
]
MaxJointTorque = Annotated[
    float | None,
    typer.Option(
        metavar="NM",
        help="With --score upright: displacement counts while no joint has a larger torque.",
        rich_help_panel=CONTROLLER,
    ),
]
MaxSelfCollision = Annotated[
    float | None,
    typer.Option(
        metavar="M",
        help="With --score upright: displacement counts until two bodies of the robot, apart from "
        "neighbours, penetrate each other deeper.",
        rich_help_panel=CONTROLLER,
    ),
]
