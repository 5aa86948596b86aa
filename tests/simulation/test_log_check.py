"""Promises of the check of healthy trials: it names the joint whose columns are wrong."""

from dataclasses import replace

import numpy as np
import pytest

from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.simulation.fit import Fit
from selfmodel.simulation.log_check import Suspicion, suspicion
from selfmodel.simulation.model_factors import nominal
from selfmodel.simulation.segments import SegmentErrors, observed_segments
from selfmodel.tasks import ROBOTS
from selfmodel.trials.estimation import JOINTS
from selfmodel.trials.trial import Trial
from tests.helpers.drivers import moving_trial

QUADRUPED = ROBOTS["quadruped"].robot()
HEALTHY = moving_trial(QUADRUPED, SimulatedRobot(QUADRUPED), seed=1)
KNEE = QUADRUPED.anatomy.hinges.index("front_left_knee")
OTHER = QUADRUPED.anatomy.hinges.index("back_right_shoulder")


def found(tried: Trial) -> Suspicion | None:
    """The suspicion of the nominal model about a trial."""
    return suspicion(*nominal_fit(tried))


def nominal_fit(tried: Trial, delay: float = 0) -> tuple[SegmentErrors, Fit]:
    """The segments of a trial, and their errors with the nominal model, said to have a delay."""
    segments, own = (
        SegmentErrors(QUADRUPED, [observed_segments(QUADRUPED, tried)], 1),
        nominal(QUADRUPED),
    )
    errors = segments.of([own])[:, 0]
    return segments, Fit("nominal", replace(own, delay=delay), {}, errors, errors)


def changed(**signals: np.ndarray) -> Trial:
    """The healthy trial with other columns."""
    return replace(HEALTHY, trajectory=HEALTHY.trajectory.with_signals(signals))


def test_a_healthy_trial_is_not_suspicious():
    assert found(HEALTHY) is None


def test_a_copy_of_segments_does_not_keep_the_predictions_of_the_original():
    segments, _ = nominal_fit(HEALTHY)
    for own in segments.data:
        assert own.known
        assert not replace(own, observed={}).known


@pytest.mark.search
def test_a_joint_with_the_other_sign_exchanged_joints_and_an_offset_are_named():
    signs, order = np.ones(len(QUADRUPED.anatomy.hinges)), np.arange(len(QUADRUPED.anatomy.hinges))
    signs[KNEE], order[[KNEE, OTHER]] = -1.0, order[[OTHER, KNEE]]
    flipped = found(changed(**{name: HEALTHY.trajectory[name] * signs for name in JOINTS}))
    swapped = found(changed(**{name: HEALTHY.trajectory[name][:, order] for name in JOINTS}))
    positions = HEALTHY.trajectory["joint_positions"].copy()
    positions[:, KNEE] += 0.2
    shifted = found(changed(joint_positions=positions))

    assert flipped is not None
    assert flipped.joint == "front_left_knee"
    assert "sign" in flipped.cause
    assert str(flipped).startswith("your healthy trials are predicted badly: check signs, order")
    assert swapped is not None
    pair = {"front_left_knee", "back_right_shoulder"}
    assert swapped.joint in pair
    assert (pair - {swapped.joint}).pop() in swapped.cause
    assert shifted is not None
    assert shifted.joint == "front_left_knee"


def test_a_delay_at_the_limit_of_the_fit_is_reported():
    suspect = suspicion(*nominal_fit(HEALTHY, delay=5))

    assert suspect is not None
    assert suspect.to_dict()["joint"] is None
    assert "control delay is 5 steps" in suspect.cause
