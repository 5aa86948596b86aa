"""What it costs to log a trial and to read it back."""

import tempfile
from pathlib import Path
from statistics import median
from time import perf_counter, process_time

import numpy as np

from selfmodel.controller import Controller, draw_weights
from selfmodel.logs import read_log
from selfmodel.logs.writer import write_trial
from selfmodel.physical import SimulatedRobot
from selfmodel.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trial import Plan

ROUNDS = 7


def measure(robot: Robot) -> dict[str, float]:
    """Returns the medians for a trial of the paper's length, its samples made beforehand."""
    settings = Settings()
    genome = draw_weights(np.random.default_rng(0), (robot.network.weights,))
    controller = Controller(robot.network, genome)
    samples = list(SimulatedRobot(robot).run(controller, settings.steps))
    plan = Plan("trial", "single", controller, settings.steps, 0)
    duration = settings.steps * robot.control_timestep
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for turn in range(ROUNDS + 1):
            path = Path(folder) / f"{turn}.mcap"
            start, start_cpu = perf_counter(), process_time()
            write_trial(path, robot, plan, samples, settings=settings)
            write, write_cpu = perf_counter() - start, process_time() - start_cpu
            start = perf_counter()
            read_log(path)
            rows.append((write, write_cpu, perf_counter() - start, path.stat().st_size))
    write, write_cpu, read, size = (median(column) for column in zip(*rows[1:], strict=True))
    return {
        "log_write_seconds": write,
        "log_write_cpu_seconds": write_cpu,
        "log_write_over_trial": write / duration,
        "log_read_seconds": read,
        "log_kilobytes": size / 1000,
    }
