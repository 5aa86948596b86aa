"""Prediction error of calibrated self-models on held-out trials, and the cost of calibration.

``python -m benchmarks.calibration [--bank DIR]`` prints a table and writes
``benchmarks/calibration/calibration.json``. With the packages of ``mujoco.sysid``
(requirements-sysid.txt in this folder) it is fitted to the same trials too. Without ``--bank``,
three gaits per robot are evolved first, in about two minutes.
"""

import argparse
import dataclasses
import json
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from statistics import mean
from time import process_time
from typing import Any

import numpy as np

from selfmodel.controllers.controller import Controller
from selfmodel.faults.hypothesis import INTACT
from selfmodel.physical.simulated import SimulatedRobot, draw_gap
from selfmodel.recovery.recover import random_stream
from selfmodel.recovery.repair import RepairSearch
from selfmodel.recovery.uncertainty import assumed_uncertainty
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.calibration import calibrate, prediction_error
from selfmodel.simulation.model_factors import Parameters, with_model, with_parameters
from selfmodel.simulation.reality_gap import RealityGap, perturbed_model
from selfmodel.simulation.simulator import Simulator
from selfmodel.studies.recoveries import bank_gait
from selfmodel.tasks import ROBOTS
from selfmodel.trials.estimation import BASE
from selfmodel.trials.trajectory import collect
from selfmodel.trials.trial import Trial, TrialPlan

RESULTS = Path(__file__).with_name("calibration.json")
NO_NOISE = 1e-12
"""Level of a gap with negligible measurement noise and initial noise."""
SEEN, UNSEEN = 2, 2
"""Number of trials to fit; also the index of the held-out gait."""

Facts = dict[str, Any]


def main() -> None:
    """Measures, prints and writes."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.calibration", description=__doc__)
    parser.add_argument("--bank", type=Path, help="a folder with ROBOT-N.npz, N from 0 to 2")
    parser.add_argument("--robots", default=",".join(ROBOTS))
    parser.add_argument("--gap", type=float, default=0.05)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--out", type=Path, default=RESULTS)
    options = parser.parse_args()
    ways = {"selfmodel": _own, "selfmodel, without the base": _without_base, **_peer()}
    rows: list[Facts] = []
    for name in options.robots.split(","):
        robot = ROBOTS[name].robot()
        gaits = [_gait(robot, number, options.bank) for number in range(SEEN + 1)]
        for seed in range(options.seeds):
            rows += _compare(
                robot, gaits, draw_gap(robot, options.gap, random_stream(seed, "gap")), ways
            )
            print(json.dumps(rows[-len(ways) - 3 :]), flush=True)
    text = json.dumps({"gap": options.gap, "rows": rows}, indent=1)
    options.out.write_text(text + "\n", encoding="utf-8")
    print(table(rows))


def _own(robot: Robot, trials: Sequence[Trial]) -> tuple[Parameters, list[float]]:
    found = calibrate(robot, trials, threads=1)
    return found.parameters, found.deviations.tolist()


def _without_base(robot: Robot, trials: Sequence[Trial]) -> tuple[Parameters, list[float]]:
    return _own(robot, [without_base(trial) for trial in trials])


Way = Callable[[Robot, Sequence[Trial]], tuple[Parameters, list[float]]]


def _peer() -> dict[str, Way]:
    """``mujoco.sysid``, if it is installed."""
    try:
        from benchmarks.calibration.sysid_peer import sysid_parameters  # noqa: PLC0415  # optional
    except ImportError as error:
        print(f"without mujoco.sysid: {error}")
        return {}
    return {"mujoco.sysid": lambda robot, trials: (sysid_parameters(robot, trials), [])}


def _compare(
    robot: Robot, gaits: Sequence[Controller], gap: RealityGap, ways: dict[str, Way]
) -> list[Facts]:
    """Returns a row per method, for the nominal model, and for the physical robot's own model."""
    noisy = SimulatedRobot(robot, gap=gap)
    trials = [_trial(robot, noisy, gaits[number]) for number in range(SEEN)]
    quiet = SimulatedRobot(robot, gap=dataclasses.replace(gap, level=NO_NOISE))
    unseen = {
        "log": _trial(robot, noisy, gaits[UNSEEN]),
        "truth": _trial(robot, quiet, gaits[UNSEEN]),
    }

    def row(way: str, model: Robot, **more: object) -> Facts:
        errors = {what: prediction_error(model, [trial], 1) for what, trial in unseen.items()}
        return {"robot": robot.name, "way": way, **errors, "delay": model.control_delay, **more}

    rows = [
        row("nominal", robot),
        row("nominal with the true delay", with_model(robot, robot.model, gap.delay)),
    ]
    for way, fit in ways.items():
        start = process_time()
        found, deviations = fit(robot, trials)
        seconds = process_time() - start
        rows.append(
            row(
                way,
                with_parameters(robot, found),
                seconds=seconds,
                delay_right=found.delay == gap.delay,
                **_against_truth(robot, gap, found, deviations),
            )
        )
    true = with_model(robot, perturbed_model(robot.model, gap), gap.delay)
    return [*rows, row("the robot's own model", true)]


def _against_truth(
    robot: Robot, gap: RealityGap, found: Parameters, deviations: Sequence[float]
) -> Facts:
    """Returns the errors of the factors' logarithms, and the errors divided by their deviations.

    Each limb has its own factor, so no common factor is true: the limbs' mass is left out.
    """
    motors = [gap.motors[name] for name in robot.anatomy.motors]
    true = np.array([gap.mass[robot.root], np.nan, gap.friction, gap.damping, *motors])
    off = np.log(found.factors) - np.log(true)
    over = np.abs(off / deviations) if len(deviations) else None
    return {
        "rms_log_error": float(np.sqrt(np.nanmean(off**2))),
        "rms_log_truth": float(np.sqrt(np.nanmean(np.log(true) ** 2))),
        "over_deviations": None if over is None else over[~np.isnan(over)].tolist(),
    }


def _trial(robot: Robot, physical: SimulatedRobot, driver: Controller) -> Trial:
    steps = Settings().steps
    trajectory = collect(robot.anatomy.names, physical.run(driver, steps))
    return Trial(TrialPlan("trial", "before", driver, steps, 0), robot.name, trajectory, "a trial")


def _gait(robot: Robot, number: int, bank: Path | None) -> Controller:
    if bank is not None:
        return bank_gait(bank, robot.name, number)
    repair = RepairSearch(Simulator(robot, threads=1), Settings())
    assumed, stream = partial(assumed_uncertainty, robot), random_stream(number, "repair")
    return repair((INTACT,), assumed, (), stream, lambda _generation: None)[0].controller


def table(rows: Sequence[Facts]) -> str:
    """Returns the means over the seeds, as Markdown."""
    lines = [
        "| robot | model | error, unseen log | error, unseen truth | processor seconds |",
        "|---|---|---|---|---|",
    ]
    for robot in dict.fromkeys(row["robot"] for row in rows):
        for way in dict.fromkeys(row["way"] for row in rows):
            same = [row for row in rows if (row["robot"], row["way"]) == (robot, way)]
            log, truth = (mean(row[what] for row in same) for what in ("log", "truth"))
            seconds = f"{mean(row['seconds'] for row in same):.1f}" if "seconds" in same[0] else "-"
            lines.append(f"| {robot} | {way} | {log:.3f} | {truth:.3f} | {seconds} |")
    return "\n".join(lines)


def without_base(trial: Trial) -> Trial:
    """Returns the trial without the base's position and linear velocity."""
    run = trial.trajectory
    forgotten = {signal: np.full_like(run[signal], np.nan) for signal in BASE}
    trajectory = dataclasses.replace(run, signals={**run.signals, **forgotten})
    return dataclasses.replace(trial, trajectory=trajectory)


if __name__ == "__main__":
    main()
