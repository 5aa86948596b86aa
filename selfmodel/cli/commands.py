"""The options of each command: the fields of a dataclass, whose docstring is the command's help.

``options.toml`` has the help of each field. A class that several commands inherit from is what the
functions that they share take.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar, dataclass_transform

from selfmodel.settings import STEPWISE, RepairSettings, Settings


@dataclass_transform(frozen_default=True, kw_only_default=True)
@dataclass(frozen=True, kw_only=True)
class Command:
    """Options of every command; each subclass is a dataclass."""

    as_json: bool = False

    def __init_subclass__(cls) -> None:
        dataclass(frozen=True, kw_only=True)(cls)


class Robot(Command):
    """A robot, and the settings of its file."""

    robot: str
    model_settings: list[str] | None = None


class Notation(Command):
    """Fault kinds that notation may name."""

    kinds: str = "all"


class Simulated(Notation):
    """A logged trial, and what it is simulated with."""

    file: Path
    hypothesis: str = "intact"
    self_model: str | None = None
    threads: int = 0


class FromLogs(Command):
    """A diagnosis of logs."""

    healthy: list[Path] | None = None
    self_model: str | None = None
    comparator: str = "auto"
    kinds: str = "default"
    genes: int | None = None
    hypothesis: str = "intact"
    calibrate: bool = True
    population: int | None = None
    generations: int | None = None
    diagnostic_search: str | None = None
    max_simulated_steps: int | None = None
    seed: int | None = None
    threads: int = 0


class Computed(Command):
    """Where a study is computed, and how its tables are written."""

    workers: int = 0
    executor: str = "processes"
    scheduler: str | None = None
    table: str | None = None
    style: str | None = None


class Study(Computed):
    """A study: its folder and its size."""

    out: Path
    cases: str = "all"
    seeds: int = 1
    seed: int = 0
    steps: int | None = Settings.steps
    trials: int = Settings.trials
    population: int = Settings.population
    generations: int = Settings.generations

    @property
    def settings(self) -> Settings:
        """The parameters of each recovery."""
        return settings_of(self)

    @property
    def every_seed(self) -> range:
        """The seeds of the study."""
        return range(self.seed, self.seed + self.seeds)


class Searched(Command):
    """The search of a diagnosis, and its limit."""

    diagnostic_search: str = Settings.diagnostic_search
    max_simulated_steps: int | None = None


class Repair(Command):
    """The repair of a study's recoveries."""

    repair: str | None = None
    search: str | None = None
    repair_population: int | None = None
    repair_generations: int | None = None
    score: str | None = None
    only: str = "1/1"


class Robots(Command):
    """List the robots; with ROBOT, its joints, sensors, motors, faults and cases of Table I."""

    robot: str | None = None
    model_settings: list[str] | None = None


class Recover(Robot, Searched):
    """Recover a robot from a failure: diagnose it from logged trials, evolve a controller.

    The physical robot is a simulated one with the failure of --case or --damage, which the
    algorithm does not read. Every physical trial becomes a log in the folder of the run.
    """

    case: int | None = None
    damage: str | None = None
    comparator: str = "auto"
    calibrate: bool = True
    gap: float = 0.0
    kinds: str = "default"
    genes: int = Settings.genes
    hypothesis: str = "intact"
    next_trial: str = "repair"
    controller: str = "network"
    neurons: int | None = None
    repair: str | None = None
    search: str | None = None
    repertoire: Path | None = None
    score: str | None = None
    reference: Path | None = None
    max_joint_speed: float | None = None
    max_joint_torque: float | None = None
    max_self_collision: float | None = None
    seed: int = 0
    steps: int | None = None
    trials: int = Settings.trials
    population: int = Settings.population
    generations: int = Settings.generations
    repair_population: int | None = None
    repair_generations: int | None = None
    cache: bool = True
    out: Path | None = None
    threads: int = 0
    report: bool = False


class RunTrial(Robot, Notation):
    """Run one trial of the simulated physical robot and write its log."""

    PANELS: ClassVar = ("Arguments", "Failure", "Controllers and trials", "Physical robot")
    out: Path
    damage: str | None = None
    controller: str = "network"
    neurons: int | None = None
    gap: float = 0.0
    steps: int = Settings.steps
    stage: str = "single"
    seed: int = 0


class Calibrate(Command):
    """Fit masses, friction, damping, motors, delay and contacts of the self-model to trials.

    Of a robot with a fixed base, gain, damping, dry friction and armature of each joint are fitted,
    and the limits of the torque that the trials reach.

    Give trials of the healthy robot: a fault in them would become part of the model. Commands
    that read logs take the new model as --robot MODEL.xml.
    """

    files: list[Path]
    out: Path
    self_model: str | None = None
    threads: int = 0


class Diagnose(FromLogs):
    """Rank hypotheses by how well they predict logged trials, without a robot.

    Give the logs in the order in which the trials were run. The self-model is fitted to the
    trials of the healthy robot: those of --healthy, and those of the stage before. The hypotheses
    predict all others.
    """

    files: list[Path]
    export: Path | None = None


class WatchLog(Command):
    """Watch a robot through its trial log: alarms, since when, and which single fault explains it.

    With --mapping, it is a recording of ROS or a table, as for `selfmodel logs import`. With
    --follow, it may be one that is being written, a recording as MCAP. Findings are JSON lines
    unless standard output is a terminal; with --out, they are diagnostics of ROS 2 too, and the
    steps around the change are a trial log.
    """

    file: Path
    healthy: list[Path]
    mapping: Path | None = None
    run: int | None = None
    follow: bool = False
    out: Path | None = None
    kinds: str = "default"
    false_alarm_every: float = 3600.0
    calibrate: bool = True
    self_model: str | None = None
    threads: int = 1


class ReplayTrial(Simulated):
    """Simulate a logged trial again from its log, and compare the two bit by bit."""

    out: Path | None = None


class Render(Simulated):
    """Draw a logged trial beside a simulation of the same controller.

    The logged motion is on the left or above, the simulation of the hypothesis beside or below
    it. In both, a limb that the hypothesis detaches is pale and a jammed part is red.
    """

    out: Path | None = None
    hypothesis: str = ""
    diagnosis: Path | None = None
    stick: bool = False
    pictures: int = 6


class View(Simulated):
    """Open a logged trial in Rerun: the body as logged, and as simulated under a hypothesis.

    Beside the bodies are the joint positions of both, and the errors over time. The command also
    prints how to open the same log in Foxglove.
    """

    out: Path | None = None
    port: int = 9876


class MakeReport(FromLogs):
    """Write a report of a run, of logs or of a campaign: one HTML file, which needs no network.

    A run is reported with the diagnosis in its folder, logs with that of --diagnosis. Without it,
    logs are diagnosed first, with the options of `selfmodel diagnose`. To a diagnosis that was made
    before, only --kinds and --comparator apply, which name its plug-ins, as no report imports what
    a file names, and to one of --diagnosis also --robot.
    """

    sources: list[Path]
    out: Path | None = None
    diagnosis: Path | None = None


class MakeRepertoire(Robot):
    """Search for gaits with diverse duty factors of the feet, and keep the best of each cell.

    Gaits that fall or do not move forward are left out.
    """

    out: Path
    controller: str = "network"
    neurons: int | None = None
    evaluations: int = 60_000
    levels: int | None = None
    steps: int = Settings.steps
    seed: int = 0
    threads: int = 0


class RepertoireInfo(Command):
    """Verify a repertoire file, and show its robot, its gaits and how it was made."""

    file: Path


class LogInfo(Command):
    """Show what logs contain, and how to open them in a viewer.

    The exit status is 1 if a log is damaged.
    """

    files: list[Path]


class Verify(Command):
    """Verify checksums, counts, digests, layout, times, names and the model of logs.

    The exit status is 0 if every log is good, otherwise 1.
    """

    files: list[Path]
    expect: str = ""


class SalvageLog(Command):
    """Save the steps before the first damage of a log in a new, valid one."""

    file: Path
    out: Path


class ImportRecording(Command):
    """Import a recording of a robot as a trial log: a bag of ROS, without ROS, or a table."""

    recording: Path
    out: Path | None = None
    mapping: Path | None = None
    run: int | None = None
    suggest: bool = False
    robot: str | None = None


class ExportTable(Command):
    """Write the signals of a trial log as a table: one row per control step."""

    log: Path
    out: Path


class Ablate(Study, Repair, Searched):
    """Compare comparators on the same trials: robots x cases x gaps x seeds.

    The results are the rates of correct diagnoses, with 95 % intervals. An interrupted ablation
    is continued by the same command.
    """

    robots: str = "all"
    damages: str = ""
    kinds: str = "default"
    comparators: str = "all"
    diagnostic_search: str = STEPWISE
    gaps: str = "0"
    next_trial: str = "bank"
    bank: Path | None = None


class RunStudy(Computed):
    """Run the study that a TOML file defines: an ablation, recoveries of bodies, or the paper's.

    The keys are `study` (ablation, suite or paper), `folder`, and the arguments of that function
    in Python. The file is kept in the folder; an interrupted study is continued by the same
    command.
    """

    file: Path


class ListSuite(Command):
    """List the domains with their tasks, cases, joints, sensors, motors and time steps."""


class RunSuite(Study, Repair, Searched):
    """Fail and recover bodies of the suite, selfmodel's and your own: bodies x cases x seeds.

    An interrupted study is continued by the same command.
    """

    PANELS: ClassVar = ("Study", "Physical robot", "Search", "Controllers and trials", "Diagnosis")
    domains: str = "all"
    tasks: str | None = None
    damages: str = ""
    gap: float = 0.0
    controller: str = "network"
    neurons: int | None = None
    comparator: str = "segment-prediction"
    kinds: str = "paper"
    steps: int | None = None


class EvolvePolicy(Command):
    """Evolve a policy for a task of the suite: its observation, its return, its random starts.

    The folder gets policy.toml with its network, which other commands take as --controller, the
    progress, and the state, from which the same command goes on.
    """

    robot: str
    out: Path
    neurons: int = 0
    population: int = 32
    generations: int = 100
    deviation: float = 0.1
    rate: float = 0.05
    steps: int = 500
    damage: str = "intact"
    seed: int = 0
    threads: int = 0


class RepeatPaper(Study):
    """Repeat the paper's experiment: its tables and figures, as PNG, PDF, CSV and Markdown.

    Each case is recovered with each comparator, and by evolution on the robot, the paper's
    control. An interrupted experiment is continued by the same command.
    """

    robots: str = "all"
    comparators: str = "forward-displacement,auto"


class Compare(Command):
    """Compare the methods of a study by pairs: tests, intervals, marginal means, figures.

    Two methods are compared on the physical robots and trials that both had. The p values are
    corrected for the number of pairs in a table by Holm's method. Nothing is run.
    """

    study: Path
    out: Path | None = None
    table: str = "csv"
    style: str | None = None


class Check(Command):
    """Check that a plug-in fulfils its contract, on simulations that the check makes.

    The exit status is 0 if every rule holds, otherwise 1.
    """

    what: str
    plug_in: str
    self_model: str | None = None


def settings_of(options: Study | Recover, score: str | None = None) -> Settings:
    """Returns the parameters of a recovery; with the score ``return``, of trials of an episode."""
    steps = options.steps or Settings.steps + (score == "return")  # the last has no reward
    small = Settings(steps=steps, trials=options.trials, generations=options.generations)
    if isinstance(options, Searched):
        small = replace(small, max_simulated_steps=options.max_simulated_steps)
    if isinstance(options, Recover | RunSuite):  # the searches of an ablation are an axis
        small = replace(small, diagnostic_search=options.diagnostic_search)
    if isinstance(options, Recover):
        small = replace(small, genes=options.genes)
    return small.scaled(options.population)


def repair_settings_of(options: Repair | Recover, settings: Settings) -> RepairSettings | None:
    """Returns the parameters of the repair; None for those of the diagnosis."""
    population, generations = options.repair_population, options.repair_generations
    if population is None and generations is None:
        return None
    own = RepairSettings(generations=generations or settings.generations)
    return own.scaled(population or settings.population)
