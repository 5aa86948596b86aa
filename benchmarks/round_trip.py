"""Diagnoses of every single fault, recorded as by a robot's driver, imported and diagnosed.

Run with ``python -m benchmarks.round_trip``; it takes five minutes on two cores, and prints the
table of ``docs/results/import.md``.
"""

import argparse
import os
import tempfile
from pathlib import Path

from selfmodel.comparators import FORWARD_DISPLACEMENT
from selfmodel.controllers.controller import Controller
from selfmodel.diagnosis.diagnose import DiagnosticSearch
from selfmodel.faults.hypothesis import INTACT, Hypothesis, canonical
from selfmodel.faults.registry import PAPER_KINDS
from selfmodel.logs import TrialLog, read_log
from selfmodel.logs.recordings.importer import import_recording, write_recording
from selfmodel.logs.recordings.mapping.mapping_file import parse_mapping
from selfmodel.logs.records import TrialHeader
from selfmodel.logs.robots import robot_of
from selfmodel.logs.writing.writer import write_trial
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.recovery.random_streams import repair_stream
from selfmodel.recovery.repair.paper_repair import RepairSearch
from selfmodel.recovery.sequential_diagnosis import diagnose_trials
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.tasks import ROBOTS
from selfmodel.trials.trial import TrialPlan
from tests.logs.recordings.rosbag import driver

SETTINGS = Settings()
SEED = 0


def main() -> None:
    """Prints a row for each single fault of the quadruped."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    robot = ROBOTS["quadruped"].robot()
    simulator = Simulator(robot, os.cpu_count() or 1)
    rng = repair_stream(SEED, 0)
    gait = RepairSearch(simulator, SETTINGS).best(INTACT, (), rng, lambda _: None)
    print("| fault | exact log | imported, with its controller | imported, commands played back |")
    print("|---|---|---|---|")
    for truth in single_faults(robot):
        with tempfile.TemporaryDirectory() as folder:
            logs = recorded(Path(folder), robot, truth, gait)
            print(f"| `{truth}` | {' | '.join(compared(log, truth) for log in logs)} |", flush=True)


def single_faults(robot: Robot) -> list[Hypothesis]:
    """Returns every hypothesis of one fault of the paper's kinds."""
    anatomy = robot.anatomy
    return [
        canonical([fault], anatomy) for kind in PAPER_KINDS for fault in kind.candidates(anatomy)
    ]


def recorded(folder: Path, robot: Robot, truth: Hypothesis, gait: Controller) -> list[TrialLog]:
    """Returns one trial as simulated, as imported, and as imported without its controller."""
    steps = SETTINGS.steps
    plan = TrialPlan("trial", "single", gait, steps, SEED)
    samples = SimulatedRobot(robot, truth).run(gait, steps)
    exact = write_trial(folder / "exact.mcap", robot, plan, samples, TrialHeader(SETTINGS))
    bag = driver.record(folder / "bag", robot, truth, gait, steps)
    mapping = parse_mapping(driver.mapping(robot, steps, None), "mapping")
    recording = import_recording(bag, mapping, robot)
    imported = [
        write_recording(folder / f"{number}.mcap", robot, recording, mapping, controller)
        for number, controller in enumerate((gait, None))
    ]
    return [read_log(path) for path in (exact, *imported)]


def compared(log: TrialLog, truth: Hypothesis) -> str:
    """Returns the best hypothesis for a log, and the distance of the truth."""
    simulator = Simulator(robot_of(log), os.cpu_count() or 1)
    search = DiagnosticSearch(simulator, FORWARD_DISPLACEMENT, log.settings, PAPER_KINDS)
    best = diagnose_trials([log.trial], search, SEED, lambda _: None).best
    distance = 1000 * float(search.evidence.distances([truth], [log.trial])[0])
    text = "right" if best == truth else f"`{best}`"
    return f"{text}, {distance:.2f} mm"


if __name__ == "__main__":
    main()
