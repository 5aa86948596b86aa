"""Promises of observed jams: one per joint that stands at one angle although it is commanded."""

import dataclasses

import pytest

from selfmodel.diagnosis.direct_evidence import DirectEvidence, JointEvidence
from selfmodel.diagnosis.observed_jams import observed_jams
from selfmodel.faults.jammed import JAMMED_AT_ANGLE
from selfmodel.faults.kind import Fault
from selfmodel.robot.robot import Robot

KNEE = "front_left_knee"
STANDS = JointEvidence(KNEE, KNEE, 0.3, 0.007, 1.0, "stands")


def evidence(knee: JointEvidence) -> DirectEvidence:
    """A trial in which this is the evidence of the knee, and another joint moves."""
    moving = JointEvidence("back_left_knee", "back_left_knee", 0.1, 0.2, 1.0, "moves")
    return DirectEvidence("trial", (knee, moving), (), ())


def test_a_joint_that_stands_in_all_trials_is_jammed_at_its_mean_angle(quadruped: Robot):
    trials = [evidence(STANDS), evidence(dataclasses.replace(STANDS, angle=0.32))]

    assert observed_jams(trials, quadruped.anatomy) == (Fault(JAMMED_AT_ANGLE, KNEE, 0.31),)


@pytest.mark.parametrize(
    "other",
    [
        dataclasses.replace(STANDS, motion="moves"),
        dataclasses.replace(STANDS, motion="unknown", angle=None, deviation=None),
        dataclasses.replace(STANDS, angle=0.5),
    ],
)
def test_a_joint_that_moves_or_is_unknown_or_stands_elsewhere_in_a_trial_is_no_jam(
    quadruped: Robot, other: JointEvidence
):
    assert observed_jams([evidence(STANDS), evidence(other)], quadruped.anatomy) == ()


def test_a_joint_without_commands_is_no_jam_and_an_angle_beyond_the_range_is_its_limit(
    quadruped: Robot,
):
    ((_, high),) = quadruped.anatomy.joint(KNEE).limits
    still = dataclasses.replace(STANDS, commanded=0.0)
    beyond = dataclasses.replace(STANDS, angle=high + 0.02)

    assert observed_jams([evidence(still)], quadruped.anatomy) == ()
    (jam,) = observed_jams([evidence(beyond)], quadruped.anatomy)
    assert jam.severity == pytest.approx(high)


def test_without_trials_there_is_no_jam(quadruped: Robot):
    assert observed_jams([], quadruped.anatomy) == ()
