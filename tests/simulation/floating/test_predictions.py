"""Promises of predictions of segments: how much segments of a trial share their steps."""

import pytest

from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.simulation.calibration_segments import calibration_segments_of
from selfmodel.simulation.floating.predictions import Predictions
from selfmodel.tasks import ROBOTS
from tests.simulation.test_calibration import trial

QUADRUPED = ROBOTS["quadruped"].robot()


@pytest.mark.parametrize(("steps", "least", "most"), [(1000, 1.0, 1.0), (60, 5.0, 10.0)])
def test_segments_of_a_long_trial_share_no_step_and_those_of_a_short_one_do(
    steps: int, least: float, most: float
):
    tried = trial(QUADRUPED, SimulatedRobot(QUADRUPED), seed=1, steps=steps)
    predictions = Predictions(QUADRUPED, [calibration_segments_of(tried)], 1)

    assert least <= predictions.overlap <= most
