"""A watch of the quadruped that the tests share, and streams of the robot with faults."""

from collections.abc import Sequence

import numpy as np
import pytest

import selfmodel
from selfmodel.controllers.playback import Playback
from selfmodel.robot.robot import Robot
from selfmodel.trials.trajectory import Sample, collect
from selfmodel.trials.trial import Trial, TrialPlan
from selfmodel.watching import Watch

HEALTHY = 2100
"""Steps of the healthy trial: about the fewest that are enough."""


def walk(robot: Robot, steps: int, frequency: float = 1.0) -> Playback:
    """A made-up gait: sinusoids in antiphase."""
    motors = robot.anatomy.motors
    phases = 2 * np.pi * (frequency * 0.01 * np.arange(steps)[:, np.newaxis] + np.arange(8) / 3)
    return Playback(motors, 0.3 * np.sin(phases))


def stream(robot: Robot, hypothesis: str, steps: int, frequency: float = 1.0) -> list[Sample]:
    """The steps of a robot with a gap, and with faults from the first step on."""
    physical = selfmodel.simulated_robot(robot, hypothesis, gap=0.05, seed=3)
    return list(physical.run(walk(robot, steps, frequency), steps))


def trial_of(robot: Robot, samples: Sequence[Sample]) -> Trial:
    """The trial of some steps."""
    rows = collect(robot.anatomy.names, samples)
    driver = Playback(robot.anatomy.motors, rows["commands"])
    return Trial(TrialPlan("healthy", "before", driver, rows.steps, 0), robot.name, rows, "healthy")


@pytest.fixture(scope="session")
def healthy(quadruped: Robot) -> list[Sample]:
    return stream(quadruped, "intact", HEALTHY)


@pytest.fixture(scope="session")
def made(quadruped: Robot, healthy: list[Sample]) -> Watch:
    return Watch(quadruped, trial_of(quadruped, healthy), kinds="body", calibrate=False)


@pytest.fixture
def watch(made: Watch) -> Watch:
    """The watch, which begins anew."""
    made.restart()
    return made
