"""Measures of exactness: a log of a robot without a gap against the robot's own self-model."""

from typing import NamedTuple
from xml.etree import ElementTree as ET

import mujoco
import numpy as np

from selfmodel.controllers.controller import CommandSource
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.mjcf.structure import MIN_ITERATIONS
from selfmodel.robot.robot import Robot
from selfmodel.simulation.requests import cut_segments
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.estimation import STATE
from selfmodel.trials.trajectory import Trajectory, collect

HORIZON = 12
"""Control steps of a segment, as in ``segment-prediction``."""


class Exactness(NamedTuple):
    """Largest error of a predicted state, and error of the simulated displacement, m."""

    prediction: float
    displacement: float


def exactness(robot: Robot, hypothesis: Hypothesis, driver: CommandSource, steps: int) -> Exactness:
    """Returns the errors of a robot's predictions and simulations under its true hypothesis."""
    log = collect(robot.anatomy.names, SimulatedRobot(robot, hypothesis).run(driver, steps))
    simulator = Simulator(robot, 1)
    run = simulator.run([(hypothesis, driver)], steps, ("base_position",)).trajectory
    difference = run["base_position"][0, -1] - log["base_position"][-1]
    return Exactness(prediction_error(simulator, hypothesis, log), np.abs(difference).max())


def prediction_error(simulator: Simulator, hypothesis: Hypothesis, log: Trajectory) -> float:
    """Returns the largest difference of a predicted state from the logged state."""
    starts = np.arange(0, log.steps - HORIZON, 5)
    segments = cut_segments(log, {s: log[s] for s in STATE}, starts, HORIZON, STATE)
    predicted = simulator.predict([hypothesis], segments).trajectory
    rows = starts[:, np.newaxis] + np.arange(HORIZON + 1)
    return max(float(np.abs(predicted[s][0] - log[s][rows]).max()) for s in STATE)


def with_options(mjcf: str, **options: str) -> str:
    """Returns an MJCF with some attributes of its options replaced."""
    root = ET.fromstring(mjcf)  # noqa: S314  # files of the tests
    for option in root.findall("option"):
        for name in options:
            option.attrib.pop(name, None)
    ET.SubElement(root, "option", options)
    return ET.tostring(root, encoding="unicode")


def remove_warm_start(model: mujoco.MjModel) -> None:
    """Sets the solver's options of an adapted model."""
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_WARMSTART
    for name, least in MIN_ITERATIONS.items():
        setattr(model.opt, name, max(least, getattr(model.opt, name)))


def bits(model: mujoco.MjModel) -> bytes:
    """Returns every number of a model."""
    buffer = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer.tobytes()
