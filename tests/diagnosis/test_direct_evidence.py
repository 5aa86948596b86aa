"""Promises of direct evidence: joints that stand, constant sensors, commands without effect."""

import json

import numpy as np
import pytest

from selfmodel.diagnosis.diagnosis import to_json
from selfmodel.diagnosis.direct_evidence import DirectEvidence, direct_evidence
from selfmodel.robot.robot import Robot
from selfmodel.trials.trial import Trial

STEPS = 300
KNEE, SENSOR = "front_left_knee", "front_left_touch"


def evidence(robot: Robot, knee: np.ndarray | float, commanded: float = 1.0) -> DirectEvidence:
    """The evidence of a trial in which all joints swing but for one knee."""
    swing = np.sin(np.arange(STEPS) * 0.1)[:, np.newaxis]
    positions = 0.4 * swing * np.ones(len(robot.anatomy.hinges))
    positions += np.random.default_rng(0).normal(0, 0.007, positions.shape)
    joint = robot.anatomy.joint(KNEE)
    positions[:, robot.anatomy.hinges.index(joint.hinges[0])] = knee
    commands = swing * np.ones(len(robot.anatomy.motors))
    commands[:, robot.anatomy.motors.index(joint.motors[0])] *= commanded
    names = robot.anatomy.names.sensors
    sensors = np.sign(swing) * np.ones(len(names))
    sensors[:, names.index(SENSOR)] = 0
    trial = Trial.from_arrays(robot, positions, commands, sensors=sensors)
    (found,) = direct_evidence([trial], robot.anatomy, {trial.path: "walk"})
    return found


def test_a_joint_that_stands_within_its_noise_while_commanded_is_named(quadruped: Robot):
    noise = np.random.default_rng(1).normal(0, 0.007, STEPS)
    found = evidence(quadruped, 0.3 + noise)
    knee = {one.joint: one for one in found.joints}[KNEE]

    assert found.trial == "walk"
    assert knee.motion == "stands"
    np.testing.assert_allclose([knee.angle, knee.deviation], [0.3, 0.007], atol=1e-3)
    assert knee.commanded > 1.9
    assert {one.motion for one in found.joints if one.joint != KNEE} == {"moves"}
    assert found.commands_without_effect == quadruped.anatomy.joint(KNEE).motors


@pytest.mark.parametrize("deviation", [0.01, 0.02, 0.05])
def test_noise_neither_hides_a_swing_of_twice_its_deviation_nor_makes_one(
    quadruped: Robot, deviation: float
):
    noise = np.random.default_rng(1).normal(0, deviation, STEPS)
    swing = 2 * deviation * np.sin(np.arange(STEPS) * 0.1)
    standing, swinging = evidence(quadruped, 0.3 + noise), evidence(quadruped, 0.3 + swing + noise)

    assert {one.joint for one in standing.joints if one.motion == "stands"} == {KNEE}
    assert {one.motion for one in swinging.joints} == {"moves"}


def test_a_sensor_that_never_changes_is_named(quadruped: Robot):
    (sensor,) = evidence(quadruped, 0.3).constant_sensors

    assert to_json(sensor) == {"sensor": SENSOR, "reading": 0.0}


def test_an_unknown_encoder_is_no_evidence_and_the_json_has_no_nan(quadruped: Robot):
    found = evidence(quadruped, np.nan)
    knee = {one.joint: one for one in found.joints}[KNEE]

    assert (knee.motion, knee.angle, knee.deviation) == ("unknown", None, None)
    assert not found.commands_without_effect
    json.dumps(to_json(found), allow_nan=False)
