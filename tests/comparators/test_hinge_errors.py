"""Promises of the loss of each hinge: it is about that hinge, and only about what is known."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from selfmodel.comparators.hinge_errors import hinge_losses
from selfmodel.trials.signals import HINGE_ERROR_SCALES, Signal

SEGMENTS, HORIZON, HINGES = 3, 12, 4
COMPARED = np.array([3, 6, 9, 12])
MOTION = np.linspace(0, 1, SEGMENTS * (HORIZON + 1) * HINGES).reshape(1, SEGMENTS, -1, HINGES)


def predicted(
    positions: np.ndarray = MOTION, velocities: np.ndarray = MOTION
) -> dict[Signal, np.ndarray]:
    return {"joint_positions": positions, "joint_velocities": velocities}


def losses(
    prediction: dict[Signal, np.ndarray],
    positions: np.ndarray = MOTION,
    velocities: np.ndarray = MOTION,
) -> np.ndarray:
    logged: dict[Signal, np.ndarray] = {
        "joint_positions": positions[0][:, COMPARED],
        "joint_velocities": velocities[0][:, COMPARED],
    }
    return hinge_losses(prediction, logged, COMPARED)


def with_hinge(values: np.ndarray, hinge: int, change: float) -> np.ndarray:
    changed = values.copy()
    changed[..., hinge] += change
    return changed


def test_a_prediction_that_equals_the_log_has_no_loss():
    assert losses(predicted()).shape == (1, SEGMENTS, HINGES)
    assert not losses(predicted()).any()


@given(st.integers(0, HINGES - 1), st.floats(1e-3, 1))
def test_an_error_of_one_hinge_is_a_loss_of_this_hinge_alone(hinge: int, error: float):
    found = losses(predicted(with_hinge(MOTION, hinge, error)))

    expected = np.log1p((error / HINGE_ERROR_SCALES["joint_positions"]) ** 2)
    assert found[..., hinge] == pytest.approx(np.full((1, SEGMENTS), expected))
    assert not np.delete(found, hinge, axis=2).any()


def test_the_losses_of_angle_and_velocity_are_added():
    angle = losses(predicted(positions=with_hinge(MOTION, 1, 0.1)))
    velocity = losses(predicted(velocities=with_hinge(MOTION, 1, 0.7)))
    both = losses(predicted(with_hinge(MOTION, 1, 0.1), with_hinge(MOTION, 1, 0.7)))

    assert velocity[..., 1].all()
    assert both == pytest.approx(angle + velocity)


def test_an_unknown_angle_is_no_evidence_and_an_unknown_velocity_leaves_the_angle():
    unknown = with_hinge(MOTION, 2, np.nan)

    assert np.isnan(losses(predicted(), positions=unknown)[..., 2]).all()
    assert losses(predicted(with_hinge(MOTION, 2, 0.1)), velocities=unknown)[..., 2].all()
    assert not np.isnan(losses(predicted(), velocities=unknown)).any()


def test_a_few_lost_measurements_do_not_change_the_loss_of_a_constant_error():
    gaps = with_hinge(MOTION, 0, 0.1)
    gaps[:, :, COMPARED[1], 0] = np.nan

    whole = losses(predicted(), positions=with_hinge(MOTION, 0, 0.1))
    assert losses(predicted(), positions=gaps) == pytest.approx(whole)
