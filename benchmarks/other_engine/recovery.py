"""Recoveries of robots in PyBullet, walks of given gaits in both engines, and their tables."""

import dataclasses
from collections.abc import Iterator, Sequence
from pathlib import Path
from time import perf_counter

import numpy as np

import selfmodel
from benchmarks.other_engine.environment import BulletEnvironment, physical_robot
from benchmarks.other_engine.reality import Damage, Reality, damage_of, draw_reality, ideal_reality
from benchmarks.rows import lines_of, markdown, rate, spread
from selfmodel.controllers.controller import CommandSource, Controller
from selfmodel.errors import WorkError, describe
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.logs import load_controller
from selfmodel.recovery.falls import falls_of
from selfmodel.recovery.result import Recovery
from selfmodel.robot.robot import Robot
from selfmodel.rotation import headings
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.studies.experiment import is_correct
from selfmodel.studies.study import Row
from selfmodel.tasks import ROBOTS
from selfmodel.trials.trajectory import Trajectory, collect, forward_displacement
from selfmodel.version import __version__

PAPER = Settings()


def recovered(
    name: str,
    case: int,
    seed: int,
    folder: Path,
    *,
    settings: Settings,
    design: str = "network",
    threads: int,
) -> Row:
    """Runs a recovery of a robot in PyBullet from a case of Table I, and returns its row."""
    entry = ROBOTS[name]
    robot, notation = entry.robot(), entry.cases[case]
    reality = draw_reality(robot, seed)
    row: Row = {
        "robot": name,
        "case": case,
        "truth": notation,
        "seed": seed,
        "settings": dataclasses.asdict(settings),
        "design": design,
        "reality": dataclasses.asdict(reality),
        "version": __version__,
    }
    start = perf_counter()
    with (
        BulletEnvironment(robot, reality, Damage(), stream=0) as healthy,
        BulletEnvironment(robot, reality, damage_of(notation, robot.anatomy), stream=1) as damaged,
    ):
        try:
            found = selfmodel.recover(
                physical_robot(healthy, robot),
                physical_robot(damaged, robot),
                robot,
                folder,
                settings=settings,
                design=design,
                seed=seed,
                threads=threads,
            )
        except WorkError as error:
            return {**row, "error": describe(error), "seconds": perf_counter() - start}
    row["seconds"] = perf_counter() - start
    return {**row, **_facts(found, robot, parse(notation, robot.anatomy), threads)}


def _facts(recovery: Recovery, robot: Robot, truth: Hypothesis, threads: int) -> Row:
    diagnosis, nominal = recovery.diagnosis, Simulator(robot, threads)
    trials = zip(recovery.trials, recovery.tried, _simulated(recovery, nominal), strict=True)
    return {
        "diagnosis": str(diagnosis.best),
        "verdict": diagnosis.verdict,
        "indistinguishable": [str(other) for other in diagnosis.indistinguishable],
        "correct": is_correct(diagnosis.best, truth, recovery.trials[1:], nominal),
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
                "heading": heading_change(trial.trajectory),
                "upright": bool(
                    falls_of(robot, INTACT, trial.trajectory) == trial.trajectory.steps
                ),
            }
            for trial, tried, simulated in trials
        ],
    }


def heading_change(trajectory: Trajectory) -> float:
    """Returns the turn to the left from the first step to the last, degrees; 720 for two rounds."""
    heading = np.unwrap(headings(trajectory["base_orientation"]))
    return round(float(np.degrees(heading[-1] - heading[0])), 1)


def _simulated(recovery: Recovery, nominal: Simulator) -> Iterator[float | None]:
    """Yields the displacement of each trial's controller in the self-model of its search, m.

    The failing trial has None: its controller was evolved for the healthy robot. So has a
    simulation that diverged.
    """
    fitted = recovery.calibration
    calibrated = Simulator(fitted.robot, nominal.threads) if fitted else nominal
    for trial, tried in zip(recovery.trials, recovery.tried, strict=True):
        simulator = nominal if trial.plan.stage == "before" else calibrated
        walked = in_mujoco(simulator, tried, trial.plan.controller, trial.plan.steps)
        yield None if trial.plan.stage == "after" else walked


def in_mujoco(
    simulator: Simulator, hypothesis: Hypothesis, driver: CommandSource, steps: int
) -> float | None:
    """Returns the displacement of a simulation, m; None if it diverged."""
    result = simulator.run([(hypothesis, driver)], steps, ("base_position",))
    return None if result.diverged[0] else float(forward_displacement(result.trajectory)[0])


def transfer_lines(
    robot: Robot, gaits: Sequence[Path], seeds: Sequence[int], steps: int = PAPER.steps
) -> Iterator[str]:
    """Yields a Markdown table, line by line: a row per gait, m in a trial of some steps.

    In brackets is the turn to the left in PyBullet, degrees.
    """
    realities = [ideal_reality(robot), *(draw_reality(robot, seed) for seed in seeds)]
    names = ["gait", "MuJoCo", "PyBullet, ideal", *(f"PyBullet, robot {seed}" for seed in seeds)]
    yield f"| {' | '.join(names)} |"
    yield "|---" * len(names) + "|"
    for path in gaits:
        gait = load_controller(path)
        simulated = in_mujoco(Simulator(robot, threads=1), INTACT, gait, steps) or 0.0
        walked = [_in_bullet(robot, gait, reality, steps) for reality in realities]
        yield f"| {path.stem} | {simulated:.1f} | {' | '.join(walked)} |"


def _in_bullet(robot: Robot, gait: Controller, reality: Reality, steps: int) -> str:
    with BulletEnvironment(robot, reality) as environment:
        samples = physical_robot(environment, robot).run(gait, steps)
        walk = collect(robot.anatomy.names, samples)
    return f"{float(forward_displacement(walk)):.1f} ({heading_change(walk):.0f})"


def table(rows: Sequence[Row]) -> str:
    """Returns rates with Wilson's 95 % intervals and medians as Markdown, by robot and case.

    A recovery that ended with an error counts as a wrong diagnosis, and as a recovery of 0 m that
    is not upright. One whose healthy robot went backwards has no ratio to the displacement before.
    """
    robots = dict.fromkeys(row["robot"] for row in rows)
    every = [{**row, "case": case} for row in rows for case in (row["case"], "all")]
    every.sort(key=lambda row: ([*robots].index(row["robot"]), row["case"] == "all", row["case"]))
    return markdown(lines_of(every, {"robot": "robot", "case": "case"}, _columns), texts=2)


def _columns(rows: Sequence[Row]) -> dict[str, str]:
    complete = [row for row in rows if "error" not in row]
    forward = [row for row in complete if row["before"] > 0]
    errors = [0.0] * (len(rows) - len(complete))
    trials = [trial for row in complete for trial in _recovery_trials(row)]
    ratios = [trial["displacement"] / trial["simulated"] for trial in trials if trial["simulated"]]
    first = [_recovery_trials(row)[0]["displacement"] / row["before"] for row in forward]
    best = [max(_recovery_trials(row), key=lambda trial: trial["displacement"]) for row in complete]
    ends = {end: spread([row[end] for row in complete]) for end in ("before", "after", "recovered")}
    return {
        "recoveries": str(len(rows)),
        "diagnosis right": rate([row.get("correct", False) for row in rows]),
        **{f"{end}, m": values for end, values in ends.items()},
        "recovered ÷ before": spread([r["recovered"] / r["before"] for r in forward] + errors),
        "first trial ÷ before": spread(first + errors),
        "physical ÷ simulated": spread(ratios),
        "upright": rate([trial["upright"] for trial in best] + [False] * len(errors)),
        "seconds": spread([row["seconds"] for row in rows]),
    }


def _recovery_trials(row: Row) -> list[Row]:
    return [trial for trial in row["trials"] if trial["stage"] == "recovery"]
