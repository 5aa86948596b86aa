"""Cost of writing and reading a trial log, and of the MCAP library's own writer and reader."""

import tempfile
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from time import perf_counter, process_time

import numpy as np
from mcap.reader import make_reader
from mcap.writer import Writer

from selfmodel.controllers.controller import Controller, draw_genomes
from selfmodel.logs import read_log
from selfmodel.logs.log_file import read_contents
from selfmodel.logs.records import TrialHeader
from selfmodel.logs.writer import TrialWriter
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.behaviour import Sample
from selfmodel.trials.trial import TrialPlan

ROUNDS = 7


def measure(robot: Robot) -> dict[str, float]:
    """Returns the medians for a trial of the paper's length, its samples made beforehand.

    The library's writer receives the same encoded messages and has its defaults: chunks of 1 MiB,
    no flush, no checksum of the data. Its reader has its defaults too: no checksum is compared,
    and no message decoded.
    """
    settings = Settings()
    network = network_for(robot)
    controller = Controller(network, draw_genomes(np.random.default_rng(0), (network.weights,)))
    samples = list(SimulatedRobot(robot).run(controller, settings.steps))
    plan = TrialPlan("trial", "single", controller, settings.steps, 0)
    duration = settings.steps * robot.control_timestep
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for turn in range(ROUNDS + 1):
            path, plain = Path(folder) / f"{turn}.mcap", Path(folder) / f"{turn}-plain.mcap"
            start, start_cpu = perf_counter(), process_time()
            delays = _write(path, robot, plan, samples)
            write, write_cpu = perf_counter() - start, process_time() - start_cpu
            start = perf_counter()
            read_log(path)
            read = perf_counter() - start
            library = _with_the_library(path, plain)
            late = float(np.percentile(delays, 99))
            rows.append((write, write_cpu, late, read, path.stat().st_size, *library))
    write, write_cpu, late, read, size, other_write, other_read, other_size = (
        median(column) for column in zip(*rows[1:], strict=True)
    )
    return {
        "log_write_seconds": write,
        "log_write_cpu_seconds": write_cpu,
        "log_write_over_trial": write / duration,
        "log_step_delay_p99_seconds": late,
        "log_read_seconds": read,
        "log_kilobytes": size / 1000,
        "library_write_seconds": other_write,
        "library_read_seconds": other_read,
        "library_kilobytes": other_size / 1000,
    }


def _write(path: Path, robot: Robot, plan: TrialPlan, samples: Sequence[Sample]) -> list[float]:
    """Writes a trial; returns the seconds that each step waited for the log."""
    delays = []
    with TrialWriter(path, robot, plan, TrialHeader(Settings())) as writer:
        for sample in samples:
            start = perf_counter()
            writer.add(sample)
            delays.append(perf_counter() - start)
    return delays


def _with_the_library(path: Path, plain: Path) -> tuple[float, float, int]:
    """Returns seconds to write and to read a log's messages with the library alone, and bytes."""
    every = read_contents(path).topics
    start = perf_counter()
    with plain.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        rows = []
        for topic, messages in every.items():
            schema = writer.register_schema(messages.type, "ros2msg", messages.schema)
            channel = writer.register_channel(topic, "cdr", schema)
            rows += [
                (log, channel, payload)
                for payload, (log, _) in zip(messages.payloads, messages.times, strict=True)
            ]
        rows.sort(key=lambda row: row[:2])
        for log, channel, payload in rows:
            writer.add_message(channel, log, payload, log)
        writer.finish()
    write = perf_counter() - start
    start = perf_counter()
    with plain.open("rb") as file:
        count = sum(1 for _ in make_reader(file).iter_messages())
    if count != len(rows):
        raise RuntimeError(f"the library read {count} of {len(rows)} messages")
    return write, perf_counter() - start, plain.stat().st_size
