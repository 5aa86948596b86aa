"""Cost of closed-loop simulation relative to its physics."""

from collections.abc import Callable
from statistics import median
from time import perf_counter

import mujoco
import numpy as np
from mujoco import rollout

from benchmarks.facts import Facts
from selfmodel import tasks
from selfmodel.controllers.controller import Controller, draw_genomes, make_batch
from selfmodel.faults.hypothesis import INTACT
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Run, Simulator

ROUNDS = 7
"""Rounds of every comparison; its variants alternate, and the medians are compared."""

LOOPED = 5
"""Runs of the loop over an environment; its cost per run is constant."""


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
    recorded = Simulator(robot, threads).run(batch, steps, ["commands"]).behaviour["commands"]
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
