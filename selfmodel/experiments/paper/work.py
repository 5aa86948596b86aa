"""Execution of the paper's experiment: gaits, recoveries, evolution on the robot.

All three evolve with the paper's exact repair EA, whatever other commands use by default: this file
alone chooses it.
"""

import math
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from selfmodel.controllers.controller import Controller
from selfmodel.evolution import Generation
from selfmodel.experiments import trial_logs
from selfmodel.experiments.arguments import comparator_choice
from selfmodel.experiments.experiment import Experiment, run as run_experiment
from selfmodel.experiments.gaits import evolve_gait
from selfmodel.experiments.grid import GridBegins, Job, PartEnds, PartResult, run_grid
from selfmodel.experiments.paper.plan import (
    ON_ROBOT,
    PaperStudy,
    check,
    gait_jobs,
    gait_path,
    recovery_jobs,
)
from selfmodel.experiments.paper.rows import EvolutionRow, rows_of
from selfmodel.experiments.study_files import as_dicts
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import PAPER_KINDS
from selfmodel.recovery.random_streams import repair_stream
from selfmodel.recovery.repair.paper_repair import RepairSearch
from selfmodel.recovery.scores.fitness import DISPLACEMENT
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.tasks import ROBOTS


def run_paper(
    study: PaperStudy,
    *,
    workers: int,
    on_progress: Callable[[GridBegins | PartEnds], None],
) -> tuple[PartEnds, ...]:
    """Runs the unfinished parts of the experiment and returns the failed ones.

    Args:
        study: The experiment.
        workers: Number of worker processes, each with one thread of physics.
        on_progress: Callback of the grid of gaits, then of the grid of recoveries.

    Raises:
        InputError: The experiment is invalid, or its folder contains another.
    """
    check(study)
    no_gait = run_grid(
        study.folder / "gaits",
        gait_jobs(study),
        _evolve_gait,
        workers=workers,
        on_progress=on_progress,
    )
    failed = run_grid(
        study.folder / "runs",
        recovery_jobs(study),
        _run_part,
        workers=workers,
        on_progress=on_progress,
    )
    return no_gait + failed


def _evolve_gait(job: Job, _part: str, run: Path) -> PartResult:
    """Evolves and writes the gait of a robot before the failure."""
    robot, settings = (
        ROBOTS[job.parameters["robot"]].robot(),
        Settings(**job.parameters["settings"]),
    )
    return evolve_gait(run.parent / f"{job.key}.npz", robot, settings, job.seed)


def _run_part(job: Job, part: str, run: Path) -> PartResult:
    return _evolve_on_robot(job, run) if part == ON_ROBOT else _recover(job, part, run)


@dataclass(frozen=True, eq=False)
class _Given:
    """What a recovery and the evolution on the robot have in common.

    Attributes:
        robot: The robot.
        truth: Its failure.
        settings: Parameters of the search.
        gait: Controller before the failure.
    """

    robot: Robot
    truth: Hypothesis
    settings: Settings
    gait: Controller


def _given(job: Job, run: Path) -> _Given:
    parameters = job.parameters
    robot = ROBOTS[parameters["robot"]].robot()
    return _Given(
        robot=robot,
        truth=parse(parameters["truth"], robot.anatomy),
        settings=Settings(**parameters["shared"]["settings"]),
        gait=trial_logs.controller(gait_path(run.parents[1], parameters["gait"]), robot),
    )


def _recover(job: Job, comparator: str, run: Path) -> PartResult:
    """Runs a recovery as in the paper and returns its rows, with its trial logs.

    There is no reality gap, so the self-model is exact and is not calibrated.
    """
    given = _given(job, run)
    folder = run / quote(comparator, safe="")
    shutil.rmtree(folder, ignore_errors=True)  # files of a killed run
    experiment = Experiment(
        robot=given.robot,
        case=job.parameters["case"],
        truth=given.truth,
        choose_comparator=comparator_choice(comparator),
        kinds=PAPER_KINDS,
        settings=given.settings,
        seed=job.seed,
        threads=1,
        folder=folder,
        gait=given.gait,
        calibrated=False,
    )
    outcome = run_experiment(experiment, on_event=lambda _: None)
    recovery, trials = rows_of(experiment, comparator, outcome)
    logs = sorted((folder / "trials").glob("*.mcap"))
    return PartResult({"recoveries": as_dicts([recovery]), "trials": as_dicts(trials)}, logs)


def _evolve_on_robot(job: Job, run: Path) -> PartResult:
    """Runs the repair EA on the damaged robot, as the paper's control does, and returns its rows.

    Without a reality gap, an evaluation on the robot is a simulation with the true failure. The
    search begins from the gait before the failure and random controllers, as a repair does.
    """
    given = _given(job, run)
    simulator = Simulator(given.robot, threads=1)
    before = _displacement(simulator, given)
    rows: list[EvolutionRow] = []

    def keep(generation: Generation) -> None:
        if math.isfinite(generation.best):
            rows.append(
                EvolutionRow(
                    robot=given.robot.name,
                    case=job.parameters["case"],
                    seed=job.seed,
                    evaluations=generation.evaluations,
                    before=before,
                    best=float(generation.best),
                )
            )

    # A stream that no repair of the recovery draws from: the control is an independent search.
    stream = repair_stream(job.seed, given.settings.trials + 1)
    RepairSearch(simulator, given.settings).best(given.truth, [given.gait], stream, keep)
    return PartResult({"evolution": as_dicts(rows)})


def _displacement(simulator: Simulator, given: _Given) -> float:
    """Returns the forward displacement before the failure, m."""
    walk = simulator.run([(INTACT, given.gait)], given.settings.steps, DISPLACEMENT.record)
    return float(DISPLACEMENT.of(given.robot, INTACT, walk.behaviour)[0])
