"""The options of the commands: their spelling, help text and place on a help page.

A command's options are the fields of its dataclass in ``commands``. Where a command takes a list of
values, they are separated by commas.
"""

import dataclasses
from inspect import Parameter, Signature
from typing import Annotated, Any, get_type_hints

import typer

from selfmodel.faults.registry import ALL_KINDS, KIND_SETS
from selfmodel.trials.trial import STAGES

FAILURE = "Failure"
PHYSICAL = "Physical robot"
CONTROLLER = "Controllers and trials"
DIAGNOSIS = "Diagnosis"
SEARCH = "Search"
STUDY = "Study"

PANELS = (STUDY, FAILURE, DIAGNOSIS, PHYSICAL, CONTROLLER, SEARCH)
"""Groups of options, in the order of a help page; a command may have ``PANELS`` of its own."""

FORMATS = ("csv", "parquet", "latex", "markdown")
"""Formats of tables."""


def signature_of(command: type) -> Signature:
    """Returns the fields of a command's dataclass as a function's parameters with typer's options.

    An option's help is that of ``CLASS.FIELD`` in ``OPTIONS``, for the command or a class it
    inherits from, or else of ``FIELD``; the order is that of ``OPTIONS``, group by group.
    """
    annotated: Any = Annotated  # with types of run time
    hints, order = get_type_hints(command), list(OPTIONS)
    panels = getattr(command, "PANELS", PANELS)
    found = []
    for field in dataclasses.fields(command):
        names = [f"{one.__name__}.{field.name}" for one in command.__mro__] + [field.name]
        name = next(name for name in names if name in OPTIONS)
        option = OPTIONS[name]
        panel = option.rich_help_panel
        place = panels.index(panel) if panel in panels else len(panels), order.index(name)
        default = Parameter.empty if field.default is dataclasses.MISSING else field.default
        typed = annotated[hints[field.name], option]
        parameter = Parameter(field.name, Parameter.KEYWORD_ONLY, default=default, annotation=typed)
        found.append((place, parameter))
    return Signature([parameter for _, parameter in sorted(found, key=lambda one: one[0])])


def _argument(metavar: str, text: str) -> Any:  # noqa: ANN401  # as typer declares it
    return typer.Argument(metavar=metavar, help=text)


def _option(
    metavar: str | None,
    text: str,
    panel: str | None = None,
    *names: str,
    default: str | bool = True,
    **limits: float,
) -> Any:  # noqa: ANN401  # as typer declares it
    """Returns an option.

    Args:
        metavar: Name of the value; None for a flag.
        text: Help text.
        panel: Group on the help page; None for the last one.
        names: Spellings; by default that of the field. The first long one is on the help page, the
            others are older ones, which keep working.
        default: Text of a default that is None; whether the help page has the default.
        limits: ``min`` and ``max``.
    """
    return typer.Option(
        *names,
        metavar=metavar,
        help=text,
        rich_help_panel=panel,
        show_default=default,
        **limits,  # type: ignore[arg-type]
    )


_CALIBRATE = _option(
    None,
    "Fit the self-model to the trials before the failure, if there are any.",
    DIAGNOSIS,
    "--calibrate/--no-calibrate",
)
_SCORES = (
    "Fitness of controllers: displacement; upright, the displacement until the first fall; energy, "
    "that less the work of the joints; return, the sum of the task's rewards; tracking, the error "
    "of the joints from a trajectory; or package.module:object."
)
_NEW_LOG = "Log to write; it must not exist."
_OUT = ("--out", "-o")

OPTIONS = {
    "robot": _argument(
        "ROBOT", "Name that `selfmodel robots` lists, or path of an MJCF or URDF file."
    ),
    "Robots.robot": _argument("[ROBOT]", "Name of a robot, or path of an MJCF or URDF file."),
    "files": _argument("FILE...", "Trial logs, NAME.mcap."),
    "file": _argument("LOG", "Trial log, NAME.mcap."),
    "sources": _argument(
        "RUN|LOG...|CAMPAIGN", "Folder of a recovery, trial logs, or folder of a campaign."
    ),
    "study": _argument(
        "STUDY",
        "Folder of ablate, paper or suite run; or its results.csv; or the results.jsonl of other "
        "methods.",
    ),
    "RepertoireInfo.file": _argument("FILE", "Repertoire, NAME.npz."),
    "SalvageLog.file": _argument("FILE", "Damaged log, or NAME.mcap.part."),
    "recording": _argument(
        "RECORDING", "A bag of ROS (folder, .mcap, .db3, .bag) or a table (.csv, .npz, .parquet)."
    ),
    "log": _argument("LOG", "Log of a trial."),
    # The study.
    "robots": _option("A,B|all", "Robots.", STUDY),
    "RepeatPaper.robots": _option("A,B|all", "The paper's robots.", STUDY),
    "domains": _option(
        "A,B|all", "Domains that `selfmodel suite list` lists, or MJCF and URDF files.", STUDY
    ),
    "tasks": _option("A,B|all", "Tasks of the domains.", STUDY, default="the first of each domain"),
    "cases": _option(
        "1,7|all", "Failures of the paper's Table I, by number.", STUDY, "--case", "--cases"
    ),
    "damages": _option(
        "NOTATION,...",
        "Further failures, in notation; with --case none, only these.",
        STUDY,
        *("--damage", "--damages"),
    ),
    "comparators": _option(
        "A,B|all",
        "Comparators, by name or package.module:object.",
        STUDY,
        *("--comparator", "--comparators"),
    ),
    "seeds": _option("N", "Runs of each combination, a seed each.", STUDY, min=1),
    "Study.seed": _option("N", "First of the seeds.", STUDY, min=0),
    "only": _option("i/n", "Only share i of n of the runs, for n machines.", STUDY),
    "table": _option(
        "|".join(FORMATS),
        f"Write the tables in this format too ({', '.join(FORMATS)}), into the folder tables of "
        "the study.",
        STUDY,
        *("--table", "--table-format"),
    ),
    # The failure and the diagnosis.
    "case": _option("N", "Failure of the paper's Table I, 1 to 10.", FAILURE),
    "damage": _option(
        "NOTATION", "Failure in notation, such as break:front_left_knee+friction=0.4.", FAILURE
    ),
    "comparator": _option(
        "NAME",
        "Comparator of simulations with logged trials: auto, the best that the logs allow; a name; "
        "or package.module:object.",
        DIAGNOSIS,
    ),
    "Recover.calibrate": _CALIBRATE,
    "kinds": _option(
        "KIND,...",
        f"Fault kinds to search: {', '.join(kind.name for kind in ALL_KINDS)}, "
        f"package.module:object; or their sets: {', '.join(KIND_SETS)}.",
        DIAGNOSIS,
    ),
    "calibrate": _CALIBRATE,
    # The physical robot, its controllers and trials.
    "gap": _option(
        "LEVEL",
        "Reality gap, 0 to 0.5: 0.05 is 5 % in masses and motors, and as much noise.",
        PHYSICAL,
    ),
    "gaps": _option("0,0.05", "Levels of the reality gap, 0 to 0.5.", PHYSICAL, "--gap", "--gaps"),
    "next_trial": _option(
        "WAY",
        "Choice of the next trial: repair, to restore the function; or disagreement, to separate "
        "indistinguishable hypotheses as long as there are any.",
        CONTROLLER,
    ),
    "Ablate.next_trial": _option(
        "WAY",
        "Choice of the trials' controllers: bank, the same gaits for all comparators; or repair or "
        "disagreement, as in `selfmodel recover`.",
        CONTROLLER,
    ),
    "score": _option(
        "NAME", _SCORES, CONTROLLER, default="displacement; upright with --repair robust"
    ),
    "controller": _option(
        "network|cpg",
        "Design that is evolved: the paper's neural network, or a central pattern generator with "
        "one oscillator per motor.",
        CONTROLLER,
    ),
    "RunTrial.controller": _option(
        "FILE",
        "Controller in a FILE.npz or LOG.mcap; or network or cpg, for one with random weights.",
        CONTROLLER,
        default="network",
    ),
    "neurons": _option(
        "N", "Hidden neurons of the network.", CONTROLLER, default="3", min=1, max=100
    ),
    "Recover.score": _option(
        "NAME", _SCORES, CONTROLLER, default="upright; displacement with --repair paper"
    ),
    "reference": _option(
        "FILE",
        "Trajectory to follow with --score tracking: LOG.mcap, or a table (.csv, .npz, .parquet) "
        "with the columns time and joints.",
        CONTROLLER,
        default="the motion of a first controller with random weights",
    ),
    "max_joint_speed": _option(
        "RAD/S", "With --score upright: displacement counts while no joint is faster.", CONTROLLER
    ),
    "max_joint_torque": _option(
        "NM",
        "With --score upright: displacement counts while no joint has a larger torque.",
        CONTROLLER,
    ),
    "max_self_collision": _option(
        "M",
        "With --score upright: displacement counts until two bodies of the robot, apart from "
        "neighbours, penetrate each other deeper.",
        CONTROLLER,
    ),
    "steps": _option("N", "Control steps of a trial.", CONTROLLER, min=2, max=10**6),
    "RunSuite.steps": _option(
        "N",
        "Control steps of a trial.",
        CONTROLLER,
        default="1000, an episode of the suite",
        min=2,
        max=10**6,
    ),
    "trials": _option("N", "Physical trials after the failing one.", CONTROLLER, min=1, max=99),
    "Ablate.trials": _option(
        "N", "Physical trials of the damaged robot.", CONTROLLER, min=1, max=99
    ),
    "bank": _option(
        "DIR", "Folder of gaits, ROBOT-0.npz to ROBOT-5.npz.", CONTROLLER, default="evolved"
    ),
    "stage": _option(
        "STAGE",
        f"Stage of the trial: {', '.join(STAGES)}. `selfmodel diagnose` fits the self-model to "
        "trials before the failure and explains all others.",
        CONTROLLER,
    ),
    # The searches.
    "repair": _option(
        "robust|paper",
        "Evolve controllers on rollouts with noise and with the uncertainty of the self-model; or "
        "as the paper does, in one exact simulation.",
        SEARCH,
    ),
    "search": _option(
        "cma-es|ea",
        "Search of the robust repair: CMA-ES with raced starts, or the paper's EA.",
        SEARCH,
        default="cma-es; ea with --repair paper",
    ),
    "Recover.search": _option(
        "cma-es|ea|repertoire",
        "Search of the robust repair: CMA-ES with raced starts, the paper's EA, or CMA-ES that "
        "starts from gaits of a repertoire.",
        SEARCH,
        default="cma-es; ea with --repair paper; repertoire with --repertoire",
    ),
    "repertoire": _option(
        "FILE", "Gaits of the healthy robot, made by `selfmodel repertoire make`.", SEARCH
    ),
    "evaluations": _option("N", "Gaits to evaluate.", SEARCH, min=1, max=10**8),
    "levels": _option(
        "N",
        "Cells along each axis, the duty factor of a foot.",
        SEARCH,
        default="20 for four feet, 5 for six",
        min=2,
        max=1000,
    ),
    "population": _option("N", "Genomes in a generation.", SEARCH, min=2, max=10_000),
    "FromLogs.population": _option(
        "N", "Genomes in a generation.", SEARCH, default="that of the first log", min=2, max=10_000
    ),
    "generations": _option("N", "Generations of each EA.", SEARCH, min=1, max=10_000),
    "FromLogs.generations": _option(
        "N", "Generations of the EA.", SEARCH, default="that of the first log", min=1, max=10_000
    ),
    # Files and the rest.
    "RunTrial.out": _option("NEW.mcap", _NEW_LOG, None, *_OUT),
    "Calibrate.out": _option("MODEL.xml", "MJCF file to write; it must not exist.", None, *_OUT),
    "Render.out": _option(
        "PICTURE",
        "Film (.gif, .mp4) or strip of stick figures (.png, .svg, .pdf) to write.",
        None,
        *_OUT,
        default="beside the log, .gif",
    ),
    "MakeReport.out": _option(
        "FILE.html",
        "File to write.",
        None,
        *_OUT,
        default="report.html, in the folder of the run or campaign",
    ),
    "MakeRepertoire.out": _option("NEW.npz", "File to write; must not exist.", None, *_OUT),
    "SalvageLog.out": _option("NEW.mcap", _NEW_LOG, None, *_OUT),
    "ImportRecording.out": _option("NEW.mcap", _NEW_LOG, None, *_OUT),
    "ExportTable.out": _option(
        "FILE", "Table to write, .csv, .npz or .parquet; it must not exist.", None, *_OUT
    ),
    "Study.out": _option(
        "DIR", "Folder of the study; an interrupted one is continued.", None, *_OUT
    ),
    "Compare.out": _option(
        "DIR", "Folder of the tables and figures.", None, *_OUT, default="STUDY/comparison"
    ),
    "Compare.table": _option(
        "|".join(FORMATS), "Format of the tables.", None, "--table", "--table-format"
    ),
    "expect": _option("SHA256", "SHA-256 that the one file must have, as from `logs verify`."),
    "mapping": _option("MAP.toml", "Topics or columns per signal and joint."),
    "suggest": _option(None, "Print a mapping to edit, and import nothing.", None, "--suggest"),
    "ImportRecording.robot": _option(
        "ROBOT", "Robot of --suggest: a robot's name, or its MJCF or URDF."
    ),
    "hypothesis": _option("NOTATION", "Hypothesis to simulate, such as break:front_left_knee."),
    "Render.hypothesis": _option(
        "NOTATION",
        "Hypothesis to simulate, such as break:front_left_knee.",
        default="intact",
    ),
    "Render.diagnosis": _option(
        "FILE.json",
        "Simulate the best hypothesis of a diagnosis: the result.json of a recovery, or the output "
        "of `selfmodel diagnose --json`.",
    ),
    "MakeReport.diagnosis": _option(
        "FILE.json",
        "Report this diagnosis of the logs, which `selfmodel diagnose --json` printed, or the "
        "result.json of a recovery, instead of a new one.",
    ),
    "Notation.kinds": _option(
        "KIND,...",
        "Third-party fault kinds that notation may name, package.module:object, in addition to all "
        "of selfmodel's.",
        default=False,
    ),
    "model_settings": _option(
        "KEY=VALUE",
        "Setting that an MJCF or URDF lacks, such as forward=-x; as in ROBOT.toml.",
        None,
        "--set",
    ),
    "self_model": _option(
        "ROBOT",
        "Self-model instead of that in the logs: a robot's name, MODEL.xml or ROBOT.urdf.",
        None,
        "--robot",
    ),
    "ReplayTrial.out": _option(
        "FIGURE.png", "Figure of the error: .png, .svg or .pdf.", None, *_OUT
    ),
    "View.out": _option(
        "NEW.rrd", "File of Rerun to write, instead of opening its viewer.", None, *_OUT
    ),
    "port": _option(
        "N",
        "Port of Rerun's viewer on this computer; a viewer that has it is used.",
        min=1,
        max=65535,
    ),
    "stick": _option(
        None, "Draw the film with stick figures, which needs no OpenGL.", None, "--stick"
    ),
    "pictures": _option("N", "Pictures of a strip.", min=2, max=50),
    "seed": _option("N", "Seed of every random choice.", min=0),
    "FromLogs.seed": _option(
        "N", "Seed of every random choice.", default="that of the first log", min=0
    ),
    "Recover.out": _option(
        "DIR", "Folder of the run, new or empty.", None, *_OUT, default="a new one in runs"
    ),
    "threads": _option("N", "Threads of the physics; 0 for one per processor.", min=0, max=1024),
    "report": _option(
        None, "Write report.html in the folder of the run, anew after each trial.", None, "--report"
    ),
    "workers": _option("N", "Processes; 0 for one per processor.", min=0, max=1024),
    "executor": _option(
        "processes|dask", "What computes the runs: processes of this machine, or a Dask cluster."
    ),
    "scheduler": _option(
        "ADDRESS",
        "Dask's scheduler, HOST:PORT; tls://HOST:PORT for a connection that is encrypted.",
        default="none",
    ),
    "as_json": _option(None, "Print one JSON object and nothing else.", None, "--json"),
}
"""Options by field, or by class and field, in the order of a help page."""
