"""``python -m benchmarks.go2``: diagnoses of a healthy Go2, by halves and thirds of its log."""

import argparse
import json
import time
from itertools import pairwise, permutations

import numpy as np

from benchmarks.go2 import recording
from selfmodel import diagnose

SERVOS = {"config": recording.SERVOS, "mjx": {"kp": 35.0, "kd": 0.5}}
"""Gains of the repository's configuration, and those that are usual in models for MJX."""


def main() -> None:
    """Diagnoses each part with each other part as the healthy trial, and prints a row for each."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.go2", description=__doc__)
    parser.add_argument("--servos", choices=SERVOS, nargs="*", default=list(SERVOS))
    for name in parser.parse_args().servos:
        robot = recording.robot_on_stand(servos=SERVOS[name])
        for count in (2, 3):
            edges = np.linspace(0, recording.ALL, count + 1).round().astype(int).tolist()
            parts = [recording.trial_of(robot, *ends) for ends in pairwise(edges)]
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
