"""What the tests share: the robots, seeded controllers, and a journal that needs no files."""

import json
import os
import signal
from dataclasses import replace
from pathlib import Path

# dm_control looks for a display as it is imported; nothing here is drawn.
os.environ["MUJOCO_GL"] = "disable"

import numpy as np
import pytest
from hypothesis import settings

from selfmodel.controllers.controller import Controller, Design, draw_genomes
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.robot.designs import cpg_for, network_for
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.tasks import ROBOTS
from selfmodel.trials.behaviour import Signal
from selfmodel.trials.trial import Trial
from tests.helpers.command import SMALL, selfmodel

settings.register_profile("unhurried", deadline=None)  # a busy machine is no bug
settings.load_profile("unhurried")

# A shell's background job ignores Ctrl-C, and hands that on to the commands that are tested.
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session", params=sorted(ROBOTS))
def robot(request: pytest.FixtureRequest) -> Robot:
    """Every registered robot in turn."""
    return ROBOTS[request.param].robot()


@pytest.fixture(scope="session")
def quadruped() -> Robot:
    return ROBOTS["quadruped"].robot()


@pytest.fixture(scope="session")
def recovered(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict]:
    """A folder in which a small recovery ran, and what it printed."""
    folder = tmp_path_factory.mktemp("recovered")
    done = selfmodel(
        "recover", "quadruped", "--case", "4", *SMALL, "--out", "run", "--json", cwd=folder
    )
    assert done.returncode == 0, done.stderr
    return folder, json.loads(done.stdout)


def random_controllers(robot: Robot, count: int, seed: int = 0) -> list[Controller]:
    """Returns networks with random weights for a robot."""
    return random_of(network_for(robot), count, seed)


def random_cpgs(robot: Robot, count: int, seed: int = 0) -> list[Controller]:
    """Returns CPGs with random genomes for a robot."""
    return random_of(cpg_for(robot), count, seed)


def random_of(design: Design, count: int, seed: int = 0) -> list[Controller]:
    """Returns controllers of a design with random genomes."""
    genomes = draw_genomes(np.random.default_rng(seed), (count, design.weights))
    return [Controller(design, genome) for genome in genomes]


def random_motion(robot: Robot, steps: int, seed: int = 0) -> np.ndarray:
    """Returns smooth motor targets that move every joint, ``(steps, motors)``, rad."""
    rng = np.random.default_rng(seed)
    phase = rng.uniform(0, 2 * np.pi, len(robot.anatomy.motors))
    return 0.6 * np.sin(2 * np.pi * np.arange(steps)[:, None] * robot.control_timestep + phase)


def exploding(simulator: Simulator, text: str) -> Hypothesis:
    """Makes a hypothesis one whose model blows up: its joints are driven, not damped."""
    hypothesis = parse(text, simulator.robot.anatomy)
    built = simulator._embodiment(hypothesis)
    built.model.dof_damping[6:] = -1e3
    return hypothesis


def lacking(trial: Trial, signals: tuple[Signal, ...], steps: slice = slice(None)) -> Trial:
    """The trial with signals that were not observed at some steps."""
    run = trial.behaviour
    lost = {signal: run[signal].copy() for signal in signals}
    for values in lost.values():
        values[steps] = np.nan
    return replace(trial, behaviour=replace(run, signals={**run.signals, **lost}))
