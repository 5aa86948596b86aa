"""Difference of simulated and physical displacement in every trial of a study at no gap.

``python -m benchmarks.lab_robots.exactness OUT`` writes ``OUT/exactness.json``: the largest
absolute difference of each run, m.
"""

import argparse
import json
from pathlib import Path

import numpy as np

from benchmarks.lab_robots.study import folder_of
from selfmodel.arguments import robot_entry
from selfmodel.experiments.grid import finished
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.logs import read_log
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import forward_displacement

HEALTHY = "00-before.mcap"


def main() -> None:
    """Computes the differences of the runs that have none yet."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path, help="folder of the study")
    out = parser.parse_args().out
    file = out / "exactness.json"
    found = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
    robots: dict[str, Robot] = {}
    for run in finished(folder_of(out, 0.0) / "runs"):
        if run.key in found:
            continue
        body = run.parameters["robot"]
        robot = robots.setdefault(body, robot_entry(body).robot())
        truth = parse(run.parameters["truth"], robot.anatomy)
        logs = sorted((run.path.parent / "recovery" / "trials").glob("*.mcap"))
        found[run.key] = max(_difference(log, robot, truth) for log in logs)
        file.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    print(f"{len(found)} runs, largest difference {max(found.values()):.3g} m")


def _difference(log: Path, robot: Robot, truth: Hypothesis) -> float:
    """Returns the difference of the displacement in a log and in a simulation of its truth, m."""
    trial = read_log(log).trial
    hidden = INTACT if log.name == HEALTHY else truth
    steps = trial.behaviour.steps
    run = Simulator(robot, threads=1).run(
        [(hidden, trial.plan.controller)], steps, ["base_position"]
    )
    physical = forward_displacement(trial.behaviour)
    return float(np.abs(forward_displacement(run.behaviour)[0] - physical))


if __name__ == "__main__":
    main()
