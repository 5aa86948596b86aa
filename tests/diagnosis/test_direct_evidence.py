"""Promises of direct evidence: joints that stand, constant sensors, commands without effect."""

import json
from dataclasses import replace

import numpy as np
import pytest

from selfmodel.arguments import kinds_of
from selfmodel.diagnosis.diagnosis import to_json
from selfmodel.diagnosis.direct_evidence import (
    DirectEvidence,
    direct_evidence,
    evident,
    observed_faults,
    standing_joints,
)
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.notation import parse
from selfmodel.robot.robot import Robot
from selfmodel.trials.trial import Trial

STEPS = 300
KNEE, SENSOR = "front_left_knee", "front_left_touch"


def trial(robot: Robot, knee: np.ndarray | float, commanded: np.ndarray | float = 1.0) -> Trial:
    """A trial in which all joints swing but for one knee."""
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
    return Trial.from_arrays(robot, positions, commands, sensors=sensors)


def evidence(robot: Robot, knee: np.ndarray | float) -> DirectEvidence:
    """The evidence of such a trial."""
    logged = trial(robot, knee)
    (found,) = direct_evidence([logged], robot.anatomy, {logged.path: "walk"})
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


def test_the_last_trial_with_commands_says_whether_a_joint_stands(quadruped: Robot):
    moves = trial(quadruped, 0.4 * np.sin(np.arange(STEPS) * 0.1))
    stands, rests = trial(quadruped, 0.3), trial(quadruped, 0.3, commanded=0)

    def standing(*trials: Trial) -> set[str]:
        return {*standing_joints(trials, quadruped.anatomy)}

    assert standing(stands) == standing(moves, stands) == standing(stands, rests) == {KNEE}
    assert standing(moves) == standing(rests) == standing(stands, moves) == set()
    ends_at_rest = 1.0 * (np.arange(STEPS) < STEPS // 2)
    assert standing(trial(quadruped, 0.3, ends_at_rest)) == {KNEE}


def test_what_stands_is_jammed_and_a_leg_of_which_all_joints_stand_locked_or_lost(
    quadruped: Robot,
):
    names, anatomy = quadruped.anatomy.names, quadruped.anatomy
    logged = trial(quadruped, 0.3)
    positions = logged.trajectory["joint_positions"].copy()
    positions[:, names.hinges.index("front_left_shoulder")] = -0.1
    positions[:, names.hinges.index("back_right_knee")] = 0.2
    leg = Trial.from_arrays(quadruped, positions, logged.trajectory["commands"])

    def shown(one: Trial, kinds: str = "default") -> list[str]:
        standing = standing_joints([one], anatomy)
        space = HypothesisSpace.of(kinds_of(kinds), anatomy)
        observed = observed_faults([one], anatomy, standing)
        return [*map(str, evident(standing, replace(space, observed=observed)))]

    jam = "jam:back_right_knee=0.2"
    assert shown(logged) == [f"jam:{KNEE}=0.3"]
    assert shown(leg) == [
        f"{jam}+leg:front_left=locked-0.1/0.3",
        f"break:front_left_shoulder+{jam}",
    ]
    space = replace(
        HypothesisSpace.of(kinds_of("default"), anatomy),
        observed=observed_faults([leg], anatomy, standing_joints([leg], anatomy)),
    )
    both = space.canonical(parse("jam:front_left_shoulder+jam:front_left_knee=0.1", anatomy).faults)
    assert str(both) == "leg:front_left=locked-0.1/0.3"
    assert shown(leg, "paper") == []  # a jam at 0 alone, and no jam at an angle
    assert shown(trial(quadruped, 0.3, commanded=0)) == []


def test_a_sensor_that_never_changes_is_named(quadruped: Robot):
    (sensor,) = evidence(quadruped, 0.3).constant_sensors

    assert to_json(sensor) == {"sensor": SENSOR, "reading": 0.0}


def test_an_unknown_encoder_is_no_evidence_and_the_json_has_no_nan(quadruped: Robot):
    found = evidence(quadruped, np.nan)
    knee = {one.joint: one for one in found.joints}[KNEE]

    assert (knee.motion, knee.angle, knee.deviation) == ("unknown", None, None)
    assert not found.commands_without_effect
    json.dumps(to_json(found), allow_nan=False)
