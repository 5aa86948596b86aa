"""``make bench``: speed, memory and their growth, measured in one run and written as JSON.

Every figure is a median of at least five rounds after a warm-up round. Ratios compare variants that
alternated in one process, with the same model, threads, initial poses and motor targets.
"""

import argparse
import json
import os
import platform
import resource
import subprocess
import sys
from pathlib import Path
from statistics import median

import mujoco
import numpy as np

from benchmarks import recovery, simulation, trial_log
from benchmarks.facts import Facts
from selfmodel.tasks import ROBOTS, entry, suite_bodies

# dm_control searches for a display on import; nothing is drawn here.
os.environ.setdefault("MUJOCO_GL", "disable")

RESULTS = Path(__file__).with_name("results.json")
POPULATION, STEPS = 100, 1000
STEPS_OF_SUITE = 100
"""Control steps for bodies of dm_control's suite; some cost 100 times as much as selfmodel's."""


def main() -> None:
    """Measures everything, prints it, and writes ``benchmarks/results.json``."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    threads = os.cpu_count() or 1
    robots = [ROBOTS[name].robot() for name in ("quadruped", "hexapod")]
    quadruped = robots[0]
    loops = [
        simulation.closed_loop_over_rollout(robot, POPULATION, STEPS, threads) for robot in robots
    ]
    results = {
        "machine": {
            "processors": threads,
            "python": platform.python_version(),
            "mujoco": mujoco.__version__,
            "numpy": np.__version__,
        },
        "closed_loop_over_rollout": loops[0]["ratio"],
        "closed_loop_over_environment": simulation.closed_loop_over_environment(
            quadruped, POPULATION, STEPS, threads
        ),
        **recovery.measure(),
        **trial_log.measure(quadruped),
        "log_of_hexapod": trial_log.measure(robots[1]),
        "help_cpu_seconds": help_cpu_seconds(),
        "closed_loop": loops,
        "closed_loop_of_suite": of_suite(threads),
        "growth": simulation.growth(robots, threads),
    }
    text = json.dumps(results, indent=2)
    RESULTS.write_text(text + "\n", encoding="utf-8")
    print(text)


def of_suite(threads: int) -> list[Facts]:
    """Returns the same ratio for a body of each domain of dm_control's suite."""
    robots = [
        entry(suite_bodies.name(domain, tasks[0])).robot()
        for domain, tasks in suite_bodies.DOMAINS.items()
    ]
    return [
        simulation.closed_loop_over_rollout(robot, POPULATION, STEPS_OF_SUITE, threads)
        for robot in robots
    ]


def help_cpu_seconds() -> float:
    """Returns the processor time of ``selfmodel --help``."""
    command = [sys.executable, "-m", "selfmodel", "--help"]
    seconds = []
    for _ in range(6):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(command, check=True, capture_output=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return median(seconds[1:])


if __name__ == "__main__":
    main()
