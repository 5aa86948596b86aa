"""Time shares and peak memory of one recovery with the paper's repair.

``python -m benchmarks.recovery`` measures one recovery in this process and prints one JSON object;
``measure`` repeats this in separate processes.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from time import perf_counter

from selfmodel.arguments import comparator_choice
from selfmodel.comparators import FORWARD_DISPLACEMENT
from selfmodel.controllers.controller import CommandSource
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import PAPER_KINDS
from selfmodel.logs.journal import create_journal
from selfmodel.logs.physical_trial import TrialRunner
from selfmodel.physical.interface import PhysicalRobot
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.recovery.recover import Journal, RecoveryLoop, RunTrial
from selfmodel.recovery.repair import RepairSearch
from selfmodel.recovery.scores import DISPLACEMENT
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.tasks import ROBOTS
from selfmodel.trials.behaviour import Sample
from selfmodel.trials.trial import Trial, TrialPlan

ROUNDS = 5


class TimedRobot:
    """A physical robot that measures the seconds of its simulation."""

    def __init__(self, robot: PhysicalRobot) -> None:
        self._robot = robot
        self.seconds = 0.0

    def run(self, controller: CommandSource, steps: int) -> Iterator[Sample]:
        """Runs a controller."""
        samples = self._robot.run(controller, steps)
        while True:
            start = perf_counter()
            sample = next(samples, None)
            self.seconds += perf_counter() - start
            if sample is None:
                return
            yield sample


class TimedLogs:
    """Logs and journal of a recovery, with the seconds of writing and reading them.

    The seconds exclude those of the physical robots.
    """

    def __init__(
        self, run_trial: RunTrial, journal: Journal, robots: tuple[TimedRobot, ...]
    ) -> None:
        self._run_trial, self._journal, self._robots = run_trial, journal, robots
        self._seconds = 0.0

    @property
    def seconds(self) -> float:
        """Seconds so far."""
        return self._seconds - sum(robot.seconds for robot in self._robots)

    def run_trial(self, physical: PhysicalRobot, plan: TrialPlan) -> Trial:
        """Runs and logs a trial."""
        start = perf_counter()
        trial = self._run_trial(physical, plan)
        self._seconds += perf_counter() - start
        return trial

    def add(self, diagnosis: Diagnosis) -> None:
        """Stores a diagnosis."""
        start = perf_counter()
        self._journal.add(diagnosis)
        self._seconds += perf_counter() - start


def measure() -> dict[str, float]:
    """Returns the medians over recoveries with the paper's budget, each in its own process."""
    command = [sys.executable, "-m", "benchmarks.recovery"]
    rounds = [
        json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        for _ in range(ROUNDS)
    ]
    return {key: median(one[key] for one in rounds) for key in rounds[0]}


def measure_once() -> dict[str, float]:
    """Returns the shares of one recovery of a quadruped from case 1, and its peak memory."""
    start = perf_counter()
    entry, settings = ROBOTS["quadruped"], Settings()
    robot = entry.robot()
    simulator = Simulator(robot, os.cpu_count() or 1)
    healthy = TimedRobot(SimulatedRobot(robot))
    damaged = TimedRobot(SimulatedRobot(robot, parse(entry.cases[1], robot.anatomy)))
    with tempfile.TemporaryDirectory() as folder:
        journal = create_journal(Path(folder) / "run", robot.anatomy, calibrated=False)
        run_trial = TrialRunner(journal.trials, robot, settings)
        timed = TimedLogs(run_trial, journal, (healthy, damaged))
        RecoveryLoop(
            simulator=simulator,
            choose_comparator=comparator_choice(FORWARD_DISPLACEMENT),
            kinds=PAPER_KINDS,
            run_trial=timed.run_trial,
            journal=timed,
            settings=settings,
            seed=0,
            on_event=lambda _: None,
            score=DISPLACEMENT,
            make_repair=RepairSearch,
        ).run(healthy, damaged)
    seconds = perf_counter() - start
    return {
        "recover_seconds": seconds,
        "physics_share_of_recover": simulator.stats.physics_seconds / seconds,
        "logs_share_of_recover": timed.seconds / seconds,
        "physical_robot_share_of_recover": (healthy.seconds + damaged.seconds) / seconds,
        "recover_peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "recover_simulated_steps": simulator.stats.steps,
    }


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__).parse_args()
    print(json.dumps(measure_once()))
