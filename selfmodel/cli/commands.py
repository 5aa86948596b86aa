"""The options of each command: the fields of a dataclass, whose docstring is the command's help."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from selfmodel.cli.options import (
    DEFAULT_KIND_NAMES,
    SEARCH,
    Calibrated,
    Case,
    ComparatorName,
    ControllerKind,
    ControllerSource,
    Damage,
    GapLevel,
    Generations,
    HypothesisText,
    Json,
    KindNames,
    LogFile,
    LogFiles,
    LoggedGenerations,
    LoggedPopulation,
    LoggedSeed,
    MaxJointSpeed,
    MaxJointTorque,
    MaxSelfCollision,
    ModelSettings,
    NamedKinds,
    Neurons,
    NewLog,
    NextTrialName,
    Population,
    RecoveryScore,
    Reference,
    RepairName,
    RepertoireFile,
    RobotName,
    SearchName,
    Seed,
    SelfModel,
    StageName,
    Steps,
    Threads,
    Trials,
)


@dataclass(frozen=True, kw_only=True)
class Robots:
    """List the robots; with ROBOT, its joints, sensors, motors, faults and cases of Table I."""

    robot: Annotated[
        str | None,
        typer.Argument(metavar="[ROBOT]", help="Name of a robot, or path of an MJCF or URDF file."),
    ] = None
    model_settings: ModelSettings = None
    as_json: Json = False


@dataclass(frozen=True, kw_only=True)
class Recover:
    """Recover a robot from a failure: diagnose it from logged trials, evolve a controller.

    The physical robot is a simulated one with the failure of --case or --damage, which the
    algorithm does not read. Every physical trial becomes a log in the folder of the run.
    """

    robot: RobotName
    case: Case = None
    damage: Damage = None
    model_settings: ModelSettings = None
    comparator: ComparatorName = "auto"
    calibrate: Calibrated = True
    gap: GapLevel = 0.0
    kinds: KindNames = DEFAULT_KIND_NAMES
    next_trial: NextTrialName = "repair"
    controller: ControllerKind = "network"
    neurons: Neurons = None
    repair: RepairName = "robust"
    search: SearchName = None
    repertoire: RepertoireFile = None
    score: RecoveryScore = None
    reference: Reference = None
    max_joint_speed: MaxJointSpeed = None
    max_joint_torque: MaxJointTorque = None
    max_self_collision: MaxSelfCollision = None
    seed: Seed = 0
    steps: Steps = 1000
    trials: Trials = 3
    population: Population = 100
    generations: Generations = 30
    out: Annotated[
        Path | None,
        typer.Option(
            *("--out", "-o"),
            metavar="DIR",
            help="Folder of the run, new or empty.",
            show_default="a new one in runs",
        ),
    ] = None
    threads: Threads = 0
    report: Annotated[
        bool,
        typer.Option(
            "--report",
            help="Write report.html in the folder of the run, anew after each trial.",
        ),
    ] = False
    as_json: Json = False


@dataclass(frozen=True, kw_only=True)
class RunTrial:
    """Run one trial of the simulated physical robot and write its log."""

    robot: RobotName
    out: NewLog
    damage: Damage = None
    kinds: NamedKinds = "all"
    model_settings: ModelSettings = None
    controller: ControllerSource = None
    neurons: Neurons = None
    gap: GapLevel = 0.0
    steps: Steps = 1000
    stage: StageName = "single"
    seed: Seed = 0
    as_json: Json = False


@dataclass(frozen=True, kw_only=True)
class Calibrate:
    """Fit masses, friction, damping, motors, delay and contacts of the self-model to trials.

    Of a robot with a fixed base, gain, damping, dry friction and armature of each joint are fitted.

    Give trials of the healthy robot: a fault in them would become part of the model. Commands
    that read logs take the new model as --robot MODEL.xml.
    """

    files: LogFiles
    out: Annotated[
        Path,
        typer.Option(
            *("--out", "-o"), metavar="MODEL.xml", help="MJCF file to write; it must not exist."
        ),
    ]
    robot: SelfModel = None
    threads: Threads = 0
    as_json: Json = False


@dataclass(frozen=True, kw_only=True)
class Diagnose:
    """Rank hypotheses by how well they predict logged trials, without a robot.

    Give the logs in the order in which the trials were run. The self-model is fitted to the
    trials from before the failure, and the hypotheses predict all others.
    """

    files: LogFiles
    robot: SelfModel = None
    comparator: ComparatorName = "auto"
    kinds: KindNames = DEFAULT_KIND_NAMES
    calibrate: Calibrated = True
    population: LoggedPopulation = None
    generations: LoggedGenerations = None
    seed: LoggedSeed = None
    threads: Threads = 0
    as_json: Json = False


@dataclass(frozen=True, kw_only=True)
class ReplayTrial:
    """Simulate a logged trial again from its log, and compare the two bit by bit."""

    file: LogFile
    hypothesis: HypothesisText = "intact"
    kinds: NamedKinds = "all"
    model: SelfModel = None
    out: Annotated[
        Path | None,
        typer.Option(
            *("--out", "-o"), metavar="FIGURE.png", help="Figure of the error: .png, .svg or .pdf."
        ),
    ] = None
    threads: Threads = 0
    as_json: Json = False


@dataclass(frozen=True, kw_only=True)
class Render:
    """Draw a logged trial beside a simulation of the same controller.

    The logged motion is on the left or above, the simulation of the hypothesis beside or below
    it. In both, a limb that the hypothesis detaches is pale and a jammed part is red.
    """

    file: LogFile
    out: Annotated[
        Path | None,
        typer.Option(
            *("--out", "-o"),
            metavar="PICTURE",
            help="Film (.gif, .mp4) or strip of stick figures (.png, .svg, .pdf) to write.",
            show_default="beside the log, .gif",
        ),
    ] = None
    hypothesis: Annotated[
        str | None,
        typer.Option(
            metavar="NOTATION",
            help="Hypothesis to simulate, such as break:front_left_knee.",
            show_default="intact",
        ),
    ] = None
    diagnosis: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.json",
            help="Simulate the best hypothesis of a diagnosis: the result.json of a recovery, or "
            "the output of `selfmodel diagnose --json`.",
        ),
    ] = None
    kinds: NamedKinds = "all"
    model: SelfModel = None
    stick: Annotated[
        bool,
        typer.Option("--stick", help="Draw the film with stick figures, which needs no OpenGL."),
    ] = False
    pictures: Annotated[
        int, typer.Option(min=2, max=50, metavar="N", help="Pictures of a strip.")
    ] = 6
    threads: Threads = 0
    as_json: Json = False


@dataclass(frozen=True, kw_only=True)
class View:
    """Open a logged trial in Rerun: the body as logged, and as simulated under a hypothesis.

    Beside the bodies are the joint positions of both, and the errors over time. The command also
    prints how to open the same log in Foxglove.
    """

    file: LogFile
    hypothesis: HypothesisText = "intact"
    kinds: NamedKinds = "all"
    model: SelfModel = None
    out: Annotated[
        Path | None,
        typer.Option(
            *("--out", "-o"),
            metavar="NEW.rrd",
            help="File of Rerun to write, instead of opening its viewer.",
        ),
    ] = None
    port: Annotated[
        int,
        typer.Option(
            min=1,
            max=65535,
            metavar="N",
            help="Port of Rerun's viewer on this computer; a viewer that has it is used.",
        ),
    ] = 9876
    threads: Threads = 0
    as_json: Json = False


@dataclass(frozen=True, kw_only=True)
class MakeReport:
    """Write a report of a run, of logs or of a campaign: one HTML file, which needs no network.

    A run is reported with the diagnosis in its folder, logs with that of --diagnosis. Without it,
    logs are diagnosed first, with the options of `selfmodel diagnose`. To a diagnosis that was made
    before, only --kinds and --comparator apply, which name its plug-ins, as no report imports what
    a file names, and to one of --diagnosis also --robot.
    """

    sources: Annotated[
        list[Path],
        typer.Argument(
            metavar="RUN|LOG...|CAMPAIGN",
            help="Folder of a recovery, trial logs, or folder of a campaign.",
        ),
    ]
    out: Annotated[
        Path | None,
        typer.Option(
            *("--out", "-o"),
            metavar="FILE.html",
            help="File to write.",
            show_default="report.html, in the folder of the run or campaign",
        ),
    ] = None
    diagnosis: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.json",
            help="Report this diagnosis of the logs, which `selfmodel diagnose --json` printed, or "
            "the result.json of a recovery, instead of a new one.",
        ),
    ] = None
    robot: SelfModel = None
    comparator: ComparatorName = "auto"
    kinds: KindNames = DEFAULT_KIND_NAMES
    calibrate: Calibrated = True
    population: LoggedPopulation = None
    generations: LoggedGenerations = None
    seed: LoggedSeed = None
    threads: Threads = 0
    as_json: Json = False


@dataclass(frozen=True, kw_only=True)
class MakeRepertoire:
    """Search for gaits with diverse duty factors of the feet, and keep the best of each cell.

    Gaits that fall or do not move forward are left out.
    """

    robot: RobotName
    out: Annotated[
        Path,
        typer.Option(*("--out", "-o"), metavar="NEW.npz", help="File to write; must not exist."),
    ]
    model_settings: ModelSettings = None
    controller: ControllerKind = "network"
    neurons: Neurons = None
    evaluations: Annotated[
        int,
        typer.Option(
            min=1, max=10**8, metavar="N", help="Gaits to evaluate.", rich_help_panel=SEARCH
        ),
    ] = 60_000
    levels: Annotated[
        int | None,
        typer.Option(
            min=2,
            max=1000,
            metavar="N",
            help="Cells along each axis, the duty factor of a foot.",
            show_default="20 for four feet, 5 for six",
            rich_help_panel=SEARCH,
        ),
    ] = None
    steps: Steps = 1000
    seed: Seed = 0
    threads: Threads = 0
    as_json: Json = False


@dataclass(frozen=True, kw_only=True)
class RepertoireInfo:
    """Verify a repertoire file, and show its robot, its gaits and how it was made."""

    file: Annotated[Path, typer.Argument(metavar="FILE", help="Repertoire, NAME.npz.")]
    as_json: Json = False


@dataclass(frozen=True, kw_only=True)
class LogInfo:
    """Show what logs contain, and how to open them in a viewer.

    The exit status is 1 if a log is damaged.
    """

    files: LogFiles
    as_json: Json = False


@dataclass(frozen=True, kw_only=True)
class Verify:
    """Verify checksums, counts, digests, layout, times, names and the model of logs.

    The exit status is 0 if every log is good, otherwise 1.
    """

    files: LogFiles
    expect: Annotated[
        str,
        typer.Option(
            metavar="SHA256", help="SHA-256 that the one file must have, as from `logs verify`."
        ),
    ] = ""
    as_json: Json = False


@dataclass(frozen=True, kw_only=True)
class SalvageLog:
    """Save the steps before the first damage of a log in a new, valid one."""

    file: Annotated[Path, typer.Argument(metavar="FILE", help="Damaged log, or NAME.mcap.part.")]
    out: NewLog
    as_json: Json = False


@dataclass(frozen=True, kw_only=True)
class ImportRecording:
    """Import a recording of a robot as a trial log: a bag of ROS, without ROS, or a table."""

    recording: Annotated[
        Path,
        typer.Argument(
            metavar="RECORDING",
            help="A bag of ROS (folder, .mcap, .db3, .bag) or a table (.csv, .npz, .parquet).",
        ),
    ]
    out: Annotated[
        Path | None,
        typer.Option(*("--out", "-o"), metavar="NEW.mcap", help="Log to write; it must not exist."),
    ] = None
    mapping: Annotated[
        Path | None,
        typer.Option(metavar="MAP.toml", help="Topics or columns per signal and joint."),
    ] = None
    suggest: Annotated[
        bool, typer.Option("--suggest", help="Print a mapping to edit, and import nothing.")
    ] = False
    robot: Annotated[
        str | None,
        typer.Option(
            metavar="ROBOT", help="Robot of --suggest: a robot's name, or its MJCF or URDF."
        ),
    ] = None
    as_json: Json = False


@dataclass(frozen=True, kw_only=True)
class ExportTable:
    """Write the signals of a trial log as a table: one row per control step."""

    log: Annotated[Path, typer.Argument(metavar="LOG", help="Log of a trial.")]
    out: Annotated[
        Path,
        typer.Option(
            *("--out", "-o"),
            metavar="FILE",
            help="Table to write, .csv, .npz or .parquet; it must not exist.",
        ),
    ]
    as_json: Json = False
