"""One recovery of a robot in PyBullet, as a row of the results."""

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import selfmodel
from benchmarks.other_engine.damage import Damage, damage_of
from benchmarks.other_engine.environment import BulletEnvironment, physical_robot
from benchmarks.other_engine.reality import draw_reality
from selfmodel.errors import WorkError, describe
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.recovery.result import Recovery
from selfmodel.recovery.scores import falls_of
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.studies.experiment import is_correct
from selfmodel.tasks import ROBOTS
from selfmodel.trials.behaviour import forward_displacement
from selfmodel.version import __version__

Row = dict[str, Any]


@dataclass(frozen=True)
class Plan:
    """The plan of a recovery.

    Attributes:
        robot: Name of the robot.
        case: Number of the failure in Table I.
        seed: Seed of the physical robot, and of the recovery.
        settings: Parameters of the recovery.
        threads: Threads of the self-model's physics; 0 for all processors.
    """

    robot: str
    case: int
    seed: int
    settings: Settings = dataclasses.field(default_factory=Settings)
    threads: int = 0


def recovered(plan: Plan, folder: Path, **options: Any) -> Row:  # noqa: ANN401  # see below
    """Runs a recovery and returns its row.

    Args:
        plan: The plan.
        folder: Folder of the run, new or empty.
        **options: Further arguments of ``selfmodel.recover``.
    """
    entry = ROBOTS[plan.robot]
    robot = entry.robot()
    notation = entry.cases[plan.case]
    reality = draw_reality(robot, plan.seed)
    row: Row = {
        "robot": plan.robot,
        "case": plan.case,
        "truth": notation,
        "seed": plan.seed,
        "settings": dataclasses.asdict(plan.settings),
        "reality": dataclasses.asdict(reality),
        "version": __version__,
    }
    start = perf_counter()
    with (
        BulletEnvironment(robot, reality, Damage(), stream=0) as healthy,
        BulletEnvironment(robot, reality, damage_of(notation, robot.anatomy), stream=1) as damaged,
    ):
        try:
            recovery = selfmodel.recover(
                physical_robot(healthy, robot),
                physical_robot(damaged, robot),
                robot,
                folder,
                settings=plan.settings,
                seed=plan.seed,
                threads=plan.threads,
                **options,
            )
        except WorkError as error:
            return {**row, "error": describe(error), "seconds": perf_counter() - start}
    row["seconds"] = perf_counter() - start
    return {**row, **_facts(recovery, robot, parse(notation, robot.anatomy), plan.threads)}


def _facts(recovery: Recovery, robot: Robot, truth: Hypothesis, threads: int) -> Row:
    diagnosis = recovery.diagnosis
    found = Simulator(robot, threads)
    return {
        "diagnosis": str(diagnosis.best),
        "verdict": diagnosis.verdict,
        "indistinguishable": [str(other) for other in diagnosis.indistinguishable],
        "correct": is_correct(diagnosis.best, truth, recovery.trials[1:], found),
        "comparator": recovery.comparator.comparator.name,
        "calibration": recovery.calibration.to_dict() if recovery.calibration else None,
        "before": recovery.before,
        "after": recovery.after,
        "recovered": recovery.recovered,
        "trials": [
            {
                "stage": trial.plan.stage,
                "hypothesis": str(tried),
                "displacement": trial.displacement,
                "simulated": simulated,
                "upright": bool(falls_of(robot, INTACT, trial.behaviour) == trial.behaviour.steps),
            }
            for trial, tried, simulated in zip(
                recovery.trials,
                recovery.tried,
                _simulated(recovery, robot, threads),
                strict=True,
            )
        ],
    }


def _simulated(recovery: Recovery, robot: Robot, threads: int) -> list[float | None]:
    """Returns the displacement of each trial's controller in the self-model that it was made in, m.

    The failing trial has None: its controller was made for the healthy robot. So has a simulation
    that diverged.
    """
    nominal = Simulator(robot, threads)
    fitted = recovery.calibration
    calibrated = nominal if fitted is None else Simulator(fitted.robot, threads)
    found: list[float | None] = []
    for trial, tried in zip(recovery.trials, recovery.tried, strict=True):
        simulator = nominal if trial.plan.stage == "before" else calibrated
        runs = [(tried, trial.plan.controller)]
        result = simulator.run(runs, trial.plan.steps, ("base_position",))
        lost = trial.plan.stage == "after" or bool(result.diverged[0])
        found.append(None if lost else float(forward_displacement(result.behaviour)[0]))
    return found
