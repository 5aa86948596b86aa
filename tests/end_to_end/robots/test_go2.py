"""A real robot's log: the calibrated model predicts what it was not fitted to, and says intact."""

import copy
import json
from pathlib import Path

import mujoco
import numpy as np
import pytest

from benchmarks.go2.__main__ import ALL, FITTED, robot_on_stand, trial_of
from selfmodel.comparators.segment_prediction import SegmentPrediction
from selfmodel.diagnosis.losses import LossTable
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.joints import WEAK_MOTOR
from selfmodel.faults.kind import Fault
from selfmodel.robot.anatomy import split_delay
from selfmodel.robot.robot import Robot
from selfmodel.simulation.model_factors import with_model
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Trial
from tests.helpers.go2 import recorded

NUMBERS = Path(__file__).parents[3] / "benchmarks" / "go2" / "go2.json"
FIELDS = {
    "damping": "dof_damping",
    "dry friction": "dof_frictionloss",
    "armature": "dof_armature",
}

pytestmark = recorded


@pytest.fixture(scope="module")
def fitted() -> Robot:
    found, robot = json.loads(NUMBERS.read_text())["fit"], robot_on_stand()
    model = copy.copy(robot.model)
    for row in found["parameters"]:
        if row["quantity"] == "gain":
            motor = model.actuator(row["name"]).id
            model.actuator_gainprm[motor] *= row["value"]
            model.actuator_biasprm[motor] *= row["value"]
        else:
            dof = model.joint(row["name"]).dofadr[0]
            getattr(model, FIELDS[row["quantity"]])[dof] = row["value"]
    return with_model(robot, model, found["delay"])


def simulated(robot: Robot, trial: Trial) -> np.ndarray:
    """The joint positions of one simulation, from the first measured ones, at rest, to the end."""
    model, data = robot.model, mujoco.MjData(robot.model)
    hinges = [int(model.joint(name).qposadr[0]) for name in robot.anatomy.hinges]
    commands = trial.trajectory["commands"]
    data.qpos[hinges] = trial.trajectory["joint_positions"][0]
    whole, part = split_delay(robot.control_delay, robot.substeps)
    found = [data.qpos[hinges].copy()]
    for step in range(len(commands) - 1):
        for delay, steps in ((whole + 1, part), (whole, robot.substeps - part)):
            data.ctrl[:] = commands[max(step - delay, 0)]
            mujoco.mj_step(model, data, steps)
        found.append(data.qpos[hinges].copy())
    return np.array(found)


def error(robot: Robot) -> float:
    """The root mean square error of the last five of 15 s, rad: the number of docs/results."""
    trial = trial_of(robot, 0, ALL)
    errors = (simulated(robot, trial) - trial.trajectory["joint_positions"])[FITTED:]
    return float(np.sqrt(np.mean(errors**2)))


def test_the_last_five_seconds_are_predicted_better_by_a_quarter(fitted: Robot):
    assert error(fitted) < 0.75 * error(robot_on_stand())


@pytest.mark.search
def test_no_weak_motor_explains_the_healthy_robot_better(fitted: Robot):
    evidence = LossTable(Simulator(fitted, 1), SegmentPrediction("segment-prediction"))
    hypotheses = [
        Hypothesis((Fault(WEAK_MOTOR, joint.name, torque),))
        for joint in fitted.anatomy.joints
        for torque in (0.95, 0.9, 0.7, 0.5, 0.0)
    ]

    intact, *rows = evidence.losses([INTACT, *hypotheses], [trial_of(fitted, FITTED, ALL)])

    assert len(rows) == 60
    assert min(row.mean() for row in rows) >= intact.mean()
