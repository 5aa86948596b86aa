"""Promises of the check of healthy trials: it names the joint whose columns are wrong."""

from dataclasses import replace

import numpy as np
import pytest

from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.simulation.log_check import Suspicion, suspicion
from selfmodel.simulation.model_factors import nominal
from selfmodel.simulation.segments import SegmentErrors, observed_segments
from selfmodel.tasks import ROBOTS
from selfmodel.trials.estimation import JOINTS
from selfmodel.trials.trial import Trial
from tests.simulation.test_calibration import trial

QUADRUPED = ROBOTS["quadruped"].robot()
HEALTHY = trial(QUADRUPED, SimulatedRobot(QUADRUPED), seed=1)
KNEE = QUADRUPED.anatomy.hinges.index("front_left_knee")
OTHER = QUADRUPED.anatomy.hinges.index("back_right_shoulder")


def found(tried: Trial) -> Suspicion | None:
    """The suspicion of the nominal model about a trial."""
    segments = SegmentErrors(QUADRUPED, [observed_segments(QUADRUPED, tried)], 1)
    parameters = nominal(QUADRUPED)
    return suspicion(segments, parameters, segments.of([parameters])[:, 0])


def changed(**signals: np.ndarray) -> Trial:
    """The healthy trial with other columns."""
    behaviour = HEALTHY.behaviour
    return replace(HEALTHY, behaviour=replace(behaviour, signals={**behaviour.signals, **signals}))


def test_a_healthy_trial_is_not_suspicious():
    assert found(HEALTHY) is None


@pytest.mark.search
def test_a_joint_with_the_other_sign_is_named():
    signs = np.ones(len(QUADRUPED.anatomy.hinges))
    signs[KNEE] = -1.0
    suspect = found(changed(**{name: HEALTHY.behaviour[name] * signs for name in JOINTS}))

    assert suspect is not None
    assert suspect.joint == "front_left_knee"
    assert "sign" in suspect.cause
    assert str(suspect).startswith("your healthy trials are predicted badly: check signs, order")


@pytest.mark.search
def test_exchanged_joints_are_named():
    order = np.arange(len(QUADRUPED.anatomy.hinges))
    order[[KNEE, OTHER]] = order[[OTHER, KNEE]]
    suspect = found(changed(**{name: HEALTHY.behaviour[name][:, order] for name in JOINTS}))

    assert suspect is not None
    pair = {"front_left_knee", "back_right_shoulder"}
    assert suspect.joint in pair
    assert (pair - {suspect.joint}).pop() in suspect.cause


@pytest.mark.search
def test_a_joint_with_an_offset_is_named():
    positions = HEALTHY.behaviour["joint_positions"].copy()
    positions[:, KNEE] += 0.2
    suspect = found(changed(joint_positions=positions))

    assert suspect is not None
    assert suspect.joint == "front_left_knee"


def test_a_delay_at_the_limit_of_the_fit_is_reported():
    segments = SegmentErrors(QUADRUPED, [observed_segments(QUADRUPED, HEALTHY)], 1)
    parameters = nominal(QUADRUPED)
    errors = segments.of([parameters])[:, 0]
    suspect = suspicion(segments, replace(parameters, delay=5), errors)

    assert suspect is not None
    assert suspect.to_dict()["joint"] is None
    assert "control delay is 5 steps" in suspect.cause
