"""What the tests of the log share: a small robot, made-up trials of it, and one log."""

import errno
import os
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from selfmodel.controllers.controller import Controller, draw_genomes
from selfmodel.logs.recordings import bags, tables
from selfmodel.logs.records import TrialHeader
from selfmodel.logs.writer import write_trial
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trajectory import Sample, StepTiming
from selfmodel.trials.trial import TrialPlan
from tests.helpers.in_process import in_this_process

MJCF = """
<mujoco model="biped">
  <option timestep="0.005"/>
  <worldbody>
    <geom name="ground" type="plane" size="0 0 1"/>
    <body name="torso" pos="0 0 0.6">
      <freejoint name="root"/>
      <geom type="box" size="0.1 0.15 0.05"/>
      <body name="left_leg" pos="0 0.2 0" euler="10 90 20">
        <joint name="left_hip_x" axis="1 0 0" range="-30 30" pos="0.01 0 0"/>
        <joint name="left_hip_y" axis="0 1 0" range="-30 30" pos="0.02 0 0.03"/>
        <geom type="capsule" size="0.03" fromto="0 0 0 0 0 -0.3"/>
        <body name="left_foot" pos="0 0 -0.3">
          <geom type="sphere" size="0.04"/>
          <site name="left_sole" type="sphere" size="0.05"/>
        </body>
      </body>
      <body name="right_leg" pos="0 -0.2 0">
        <joint name="right_hip_x" axis="1 0 0" range="-30 30"/>
        <joint name="right_hip_y" axis="0 1 0" range="-30 30"/>
        <geom type="capsule" size="0.03" fromto="0 0 0 0.3 0 0"/>
        <body name="right_foot" pos="0 0 -0.3">
          <geom type="cylinder" size="0.04 0.02"/>
          <site name="right_sole" type="sphere" size="0.05"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="left_hip_x" joint="left_hip_x" kp="10"/>
    <position name="left_hip_y" joint="left_hip_y" kp="10"/>
    <position name="right_hip_x" joint="right_hip_x" kp="10"/>
    <position name="right_hip_y" joint="right_hip_y" kp="10"/>
  </actuator>
  <sensor>
    <touch name="left_touch" site="left_sole"/>
    <touch name="right_touch" site="right_sole"/>
    <jointpos name="left_angle" joint="left_hip_y"/>
  </sensor>
</mujoco>
"""

STEPS = 120


@pytest.fixture(scope="session")
def biped() -> Robot:
    """A robot whose legs have two hinges each, some beside their body's origin."""
    return Robot("biped", MJCF, 0.01)


@pytest.fixture(scope="session")
def plan(biped: Robot) -> TrialPlan:
    """A trial of the biped that is long enough for some flushes."""
    return plan_of(biped, STEPS)


@pytest.fixture(scope="session")
def sound(biped: Robot, plan: TrialPlan, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished log of a made-up trial, which no test changes."""
    path = tmp_path_factory.mktemp("sound") / "trial.mcap"
    samples = made_up(biped, STEPS)
    return write_trial(path, biped, plan, samples, TrialHeader(Settings(), hidden="intact"))


@pytest.fixture
def log(sound: Path, tmp_path: Path) -> Path:
    """A copy of the finished log."""
    path = tmp_path / "trial.mcap"
    path.write_bytes(sound.read_bytes())
    return path


@pytest.fixture(autouse=True)
def in_process(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Opens recordings without a child process, as models; a test with the mark ``process`` not."""
    if request.node.get_closest_marker("process") is None:
        for module in (bags, tables):
            monkeypatch.setattr(module, "run_isolated", in_this_process)


def plan_of(robot: Robot, steps: int, name: str = "00-before") -> TrialPlan:
    """Returns a plan with a random controller."""
    genome = draw_genomes(np.random.default_rng(1), (network_for(robot).weights,))
    return TrialPlan(name, "before", Controller(network_for(robot), genome), steps, seed=7)


def full(*_: object, error: int = errno.ENOSPC) -> None:
    """Fails as a call of the operating system does, by default on a full disk."""
    raise OSError(error, os.strerror(error))


class MadeUpRobot:
    """A physical robot with made-up samples, which may stop early, and end with an error."""

    def __init__(self, robot: Robot, steps: int = 10**6, error: Exception | None = None) -> None:
        self._robot, self._steps, self._error = robot, steps, error

    def run(self, controller: Controller, steps: int) -> Iterator[Sample]:
        """Yields made-up samples that depend on the controller."""
        seed = int(controller.genome.sum() * 100) % 1000
        yield from made_up(self._robot, min(steps, self._steps), seed)
        if self._error is not None:
            raise self._error


def timed(samples: Iterable[Sample]) -> Iterator[Sample]:
    """Yields the samples with made-up moments: some late, some missing."""
    for k, sample in enumerate(samples):
        yield replace(sample, moment=StepTiming(1.01 * sample.time, k % 7 == 3, k % 11 == 5))


def made_up(robot: Robot, steps: int, seed: int = 0) -> Iterator[Sample]:
    """Yields samples of random numbers, of which no two are alike."""
    rng = np.random.default_rng(seed)
    names = robot.anatomy.names
    for k in range(steps):
        rows = {signal: rng.normal(size=names.width(signal)) for signal in SIGNALS}
        yield Sample(k * robot.control_timestep, rows)
