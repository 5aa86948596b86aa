"""Promises of batches: their memory."""

import pytest

from selfmodel.isolation import available_memory
from selfmodel.robot.robot import Robot
from selfmodel.simulation.batch import batch_bytes, hypothesis_bytes, largest_batch
from selfmodel.simulation.requests import ClosedLoop, Ensemble, Request

RECORD = ("base_position", "sensors")
STEPS = 60


@pytest.mark.parametrize(
    ("request_", "models"), [(ClosedLoop(RECORD), 1), (Ensemble(RECORD, members=6, level=0.05), 6)]
)
def test_each_simulation_counts_its_model_and_its_signals(
    quadruped: Robot, request_: Request, models: int
):
    needed = hypothesis_bytes(quadruped, request_, STEPS)
    signals = models * STEPS * (3 + len(quadruped.anatomy.sensors)) * 8

    assert needed > models * quadruped.model.nbuffer + signals
    assert hypothesis_bytes(quadruped, request_, 10**6) > 10**6 * signals / STEPS


def test_a_batch_fits_into_the_available_memory(quadruped: Robot):
    size = largest_batch(quadruped, ClosedLoop(RECORD), STEPS)

    assert size > 1
    assert size * hypothesis_bytes(quadruped, ClosedLoop(RECORD), STEPS) <= batch_bytes()
    assert batch_bytes() < available_memory()


def test_a_hypothesis_that_does_not_fit_is_simulated_alone(quadruped: Robot):
    assert largest_batch(quadruped, ClosedLoop(RECORD), 10**9) == 1
