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
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from statistics import median
from time import perf_counter, process_time
from typing import Any

import mujoco
import numpy as np
from mcap.reader import make_reader
from mcap.writer import Writer
from mujoco import rollout

from selfmodel import plugins, tasks
from selfmodel.arguments import comparator_choice
from selfmodel.comparators import FORWARD_DISPLACEMENT
from selfmodel.controllers.controller import CommandSource, Controller, draw_genomes, make_batch
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import PAPER_KINDS
from selfmodel.logs import read_log
from selfmodel.logs.log_file import read_contents
from selfmodel.logs.physical_trial import TrialRunner
from selfmodel.logs.records import TrialHeader
from selfmodel.logs.writer import TrialWriter
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.recovery.scores import DISPLACEMENT
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Run, Simulator
from selfmodel.studies import experiment as experiments
from selfmodel.studies.experiment import Experiment, run
from selfmodel.tasks import ROBOTS, Entry, entry, suite_bodies
from selfmodel.trials.trajectory import Sample
from selfmodel.trials.trial import TrialPlan

# dm_control searches for a display on import; nothing is drawn here.
os.environ.setdefault("MUJOCO_GL", "disable")

ROUNDS, RECOVERIES = 7, 5
"""Rounds of every comparison, whose variants alternate; recoveries, each in its own process."""

LOOPED = 5
"""Runs of the loop over an environment; its cost per run is constant."""

Facts = dict[str, Any]
"""JSON values by name."""

RESULTS = Path(__file__).with_name("results.json")
POPULATION, STEPS = 100, 1000
STEPS_OF_SUITE = 100
"""Control steps for bodies of dm_control's suite; some cost 100 times as much as selfmodel's."""


def main() -> None:
    """Measures everything, prints it, and writes ``benchmarks/results.json``."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--recovery", action="store_true", help="print the figures of one recovery")
    if parser.parse_args().recovery:
        print(json.dumps(one_recovery()))
        return
    threads = os.cpu_count() or 1
    robots = [ROBOTS[name].robot() for name in ("quadruped", "hexapod")]
    quadruped = robots[0]
    loops = [closed_loop_over_rollout(robot, POPULATION, STEPS, threads) for robot in robots]
    results = {
        "machine": {
            "processors": threads,
            "python": platform.python_version(),
            "mujoco": mujoco.__version__,
            "numpy": np.__version__,
        },
        "closed_loop_over_rollout": loops[0]["ratio"],
        "closed_loop_over_environment": closed_loop_over_environment(
            quadruped, POPULATION, STEPS, threads
        ),
        **median_recovery(),
        **trial_log(quadruped),
        "log_of_hexapod": trial_log(robots[1]),
        "help_cpu_seconds": help_cpu_seconds(),
        "closed_loop": loops,
        "closed_loop_of_suite": of_suite(threads),
        "growth": growth(robots, threads),
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
        closed_loop_over_rollout(robot, POPULATION, STEPS_OF_SUITE, threads) for robot in robots
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


def runs(robot: Robot, count: int) -> list[Run]:
    """Returns runs of the healthy robot with random controllers."""
    network = network_for(robot)
    genomes = draw_genomes(np.random.default_rng(0), (count, network.weights))
    return [(INTACT, Controller(network, genome)) for genome in genomes]


def closed_loop_over_rollout(robot: Robot, count: int, steps: int, threads: int) -> Facts:
    """Compares closed-loop steps per second with those of open-loop ``mujoco.rollout``.

    Both have the same model, threads and initial poses, and the closed loop's motor targets.
    """
    batch = runs(robot, count)
    recorded = Simulator(robot, threads).run(batch, steps, ["commands"]).trajectory["commands"]
    targets = np.repeat(recorded[:, :-1], robot.substeps, axis=1)
    start = _start(robot, count)
    datas = [mujoco.MjData(robot.model) for _ in range(threads)]
    simulator = Simulator(robot, threads)
    with rollout.Rollout(nthread=threads) as pool:
        closed, opened = _in_turns(
            lambda: simulator.run(batch, steps, ["base_position"]),
            lambda: pool.rollout([robot.model] * count, datas, start, targets),
        )
    return {
        "robot": robot.name,
        "runs": count,
        "steps": steps,
        "closed_loop_steps_per_second": count * steps / closed,
        "rollout_steps_per_second": count * steps / opened,
        "ratio": opened / closed,
    }


def closed_loop_over_environment(robot: Robot, count: int, steps: int, threads: int) -> float:
    """Returns closed-loop steps per second over those of a loop over ``Environment.step``."""
    batch = runs(robot, count)
    simulator = Simulator(robot, threads)
    environment = tasks.load(robot.name, "walk")
    action = np.empty((1, robot.model.nu))

    def loop() -> None:
        for _, controller in batch[:LOOPED]:
            alone = make_batch([controller], [frozenset()], len(robot.anatomy.sensors))
            step = environment.reset()
            for _ in range(steps - 1):
                alone.readings[:] = step.observation["sensors"]
                alone.step(action)
                step = environment.step(action[0])

    closed, looped = _in_turns(lambda: simulator.run(batch, steps, ["base_position"]), loop)
    return (count * steps / closed) / (LOOPED * steps / looped)


def growth(robots: list[Robot], threads: int) -> list[Facts]:
    """Returns the cost by population, steps and joints."""
    cells = [(robot, 100, 500) for robot in robots]
    cells += [(robots[0], count, 500) for count in (10, 25, 50, 200, 400)]
    cells += [(robots[0], 100, steps) for steps in (250, 1000, 2000)]
    rows = []
    for robot, count, steps in cells:
        simulator, batch = Simulator(robot, threads), runs(robot, count)
        (seconds,) = _in_turns(lambda: simulator.run(batch, steps, ["base_position"]), rounds=5)  # noqa: B023  # called at once
        rows.append(
            {
                "robot": robot.name,
                "hinges": len(robot.anatomy.hinges),
                "runs": count,
                "steps": steps,
                "seconds": seconds,
                "microseconds_per_step": 1e6 * seconds / (count * steps),
            }
        )
    return rows


def _start(robot: Robot, count: int) -> np.ndarray:
    kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
    data = mujoco.MjData(robot.model)
    mujoco.mj_forward(robot.model, data)
    state = np.empty(mujoco.mj_stateSize(robot.model, kind))
    mujoco.mj_getState(robot.model, data, state, kind)
    return np.tile(state, (count, 1))


def _in_turns(*works: Callable[[], object], rounds: int = ROUNDS) -> list[float]:
    """Returns the median wall seconds per function, alternating after a warm-up round."""
    seconds: list[list[float]] = [[] for _ in works]
    for turn in range(rounds + 1):
        for work, taken in zip(works, seconds, strict=True):
            start = perf_counter()
            work()
            if turn:
                taken.append(perf_counter() - start)
    return [median(taken) for taken in seconds]


class TimedRobot(SimulatedRobot):
    """A physical robot that measures the seconds of its simulation."""

    seconds = 0.0
    """Of all robots together."""

    def run(self, controller: CommandSource, steps: int) -> Iterator[Sample]:
        """Runs a controller."""
        samples = super().run(controller, steps)
        while True:
            start = perf_counter()
            sample = next(samples, None)
            TimedRobot.seconds += perf_counter() - start
            if sample is None:
                return
            yield sample


def median_recovery() -> dict[str, float]:
    """Returns the medians over recoveries with the paper's budget, each in its own process."""
    command = [sys.executable, "-m", "benchmarks.bench", "--recovery"]
    rounds = [
        json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        for _ in range(RECOVERIES)
    ]
    return {key: median(one[key] for one in rounds) for key in rounds[0]}


def one_recovery() -> dict[str, float]:
    """Returns the shares of one recovery of a quadruped from case 1, and its peak memory.

    The seconds of logs are those of trials and diagnoses that are stored, without the simulation of
    the physical robots.
    """
    robot, spent = ROBOTS["quadruped"].robot(), [0.0]

    def timed(owner: object, name: str) -> None:
        original = getattr(owner, name)

        def call(*arguments: object) -> object:
            start = perf_counter()
            result = original(*arguments)
            spent[0] += perf_counter() - start
            return result

        setattr(owner, name, call)

    timed(TrialRunner, "__call__")
    timed(experiments, "add_diagnosis")
    with tempfile.TemporaryDirectory() as folder:
        experiment = Experiment(
            robot=robot,
            case=1,
            truth=parse(ROBOTS["quadruped"].cases[1], robot.anatomy),
            choose_comparator=comparator_choice(FORWARD_DISPLACEMENT),
            kinds=PAPER_KINDS,
            settings=Settings(),
            seed=0,
            threads=os.cpu_count() or 1,
            folder=Path(folder) / "run",
            calibrated=False,
            score=DISPLACEMENT,
            repair=plugins.PAPER,
            entry=Entry(lambda: robot, physical=TimedRobot),
        )
        outcome = run(experiment, lambda _event: None)
    seconds, stats = outcome.seconds, outcome.stats
    return {
        "recover_seconds": seconds,
        "physics_share_of_recover": stats.physics_seconds / seconds,
        "logs_share_of_recover": (spent[0] - TimedRobot.seconds) / seconds,
        "physical_robot_share_of_recover": TimedRobot.seconds / seconds,
        "recover_peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "recover_simulated_steps": stats.steps,
    }


def trial_log(robot: Robot) -> dict[str, float]:
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


if __name__ == "__main__":
    main()
