"""``python -m benchmarks.go2``: diagnoses of a healthy Go2, by halves and thirds of its log.

The recording and the model are in ``../shared/samples/go2-stand`` (see its README). The model has
motors of torque, and the robot's controller is a position servo, so the motors become servos with
the gains of that README.
"""

import argparse
import json
import time
from collections.abc import Mapping
from itertools import pairwise, permutations
from pathlib import Path

import numpy as np

from selfmodel import Trial, diagnose
from selfmodel.robot.mjcf.load import adapt_text
from selfmodel.robot.mjcf.settings import checked_settings
from selfmodel.robot.robot import Robot

SAMPLE = Path(__file__).parents[3] / "shared" / "samples" / "go2-stand"
RATE = 200
"""Control steps per second."""

FITTED, ALL = 10 * RATE, 15 * RATE
"""Steps that the model is fitted to, and all steps."""

SERVOS = {"config": {"kp": 20.0, "kd": 1.5}, "mjx": {"kp": 35.0, "kd": 0.5}}
"""Gains, N m/rad and N m s/rad: those of the robot's own controller by the repository, and those
that are usual in models for MJX."""

_PHYSICS_TIMESTEP = 0.0025
"""Physics time step, s: a control step of the recording is a multiple of it."""


def robot_on_stand(servos: Mapping[str, float] = SERVOS["config"]) -> Robot:
    """Returns the robot of the recording, with its base fixed and with position servos."""
    text = (SAMPLE / "go2.xml").read_text(encoding="utf-8")
    text = text.replace("<option ", f'<option timestep="{_PHYSICS_TIMESTEP}" ', 1)
    settings = checked_settings({"base": "fixed", "control_timestep": 1 / RATE, **servos})
    return adapt_text("go2-stand", text, {}, settings)


def trial_of(robot: Robot, first: int, last: int) -> Trial:
    """Returns steps of the recording as a trial; it has joint positions and commands only."""
    with np.load(SAMPLE / "go2-stand.npz", allow_pickle=False) as data:
        order = [data["joint_names"].tolist().index(name) for name in robot.anatomy.hinges]
        arrays = (data[name][first:last, order] for name in ("position", "command"))
        return Trial.from_arrays(robot, *arrays, name=f"go2-{first}-{last}")


def main() -> None:
    """Diagnoses each part with each other part as the healthy trial, and prints a row for each."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.go2", description=__doc__)
    parser.add_argument("--servos", choices=SERVOS, nargs="*", default=list(SERVOS))
    for name in parser.parse_args().servos:
        robot = robot_on_stand(SERVOS[name])
        for count in (2, 3):
            edges = np.linspace(0, ALL, count + 1).round().astype(int).tolist()
            parts = [trial_of(robot, *ends) for ends in pairwise(edges)]
            for healthy, trial in permutations(range(count), 2):
                start = time.process_time()
                found = diagnose(
                    parts[trial], healthy=parts[healthy], robot=robot, seed=0, threads=1
                )
                row = {
                    "servos": name,
                    "parts": count,
                    "healthy": healthy,
                    "trial": trial,
                    "best": str(found.best),
                    "verdict": found.verdict,
                    "reason": found.doubt.reason if found.doubt else "",
                    "seconds": round(time.process_time() - start),
                }
                print(json.dumps(row), flush=True)


if __name__ == "__main__":
    main()
