"""Promises of the loss on encoder motion: it stands or it moves, by the encoder's own noise."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from selfmodel.comparators.encoder_motion import encoder_motion_loss, logged_motion

HORIZON, STEPS, HINGES = 12, 961, 4
STARTS = np.arange(0, STEPS - HORIZON, HORIZON)
STAND = 0.3


def swinging(amplitude: float) -> np.ndarray:
    """Angles of joints that swing at 1.5 Hz, each out of step, ``(steps, hinges)``."""
    time = np.arange(STEPS)[:, np.newaxis] * 0.01
    return amplitude * np.sin(2 * np.pi * 1.5 * time + np.arange(HINGES))


def with_hinge(angles: np.ndarray, column: np.ndarray | float) -> np.ndarray:
    """The angles, with other ones of the first hinge."""
    changed = angles.copy()
    changed[:, 0] = column
    return changed


def noisy(angles: np.ndarray, deviation: float) -> np.ndarray:
    """The angles with noise."""
    return angles + np.random.default_rng(0).normal(0, deviation, angles.shape)


def segments(angles: np.ndarray) -> np.ndarray:
    """A prediction of every segment, ``(segments, horizon + 1, hinges)``."""
    return angles[STARTS[:, np.newaxis] + np.arange(HORIZON + 1)]


def mean_loss(predicted: np.ndarray, logged: np.ndarray) -> float:
    """The mean loss of one prediction of angles ``(steps, hinges)``."""
    resting = np.median(logged[STARTS], axis=0)
    motion = logged_motion(logged, STARTS, HORIZON, resting)
    return float(encoder_motion_loss(segments(predicted)[np.newaxis], motion).mean())


@given(st.floats(0, 1), st.floats(0, 0.1))
def test_the_motion_of_the_log_itself_has_no_loss(amplitude: float, deviation: float):
    logged = noisy(swinging(amplitude), deviation)

    assert mean_loss(logged, logged) == 0


@pytest.mark.parametrize("deviation", [0, 0.01, 0.02])
def test_a_jam_is_contradicted_by_a_knee_that_swings_a_sixth_of_a_radian(deviation: float):
    logged = noisy(swinging(0.085), deviation)
    moving, jammed = swinging(0.085), with_hinge(swinging(0.085), 0.05)

    assert mean_loss(jammed, logged) > mean_loss(moving, logged) + 0.1


@pytest.mark.parametrize("deviation", [0, 0.01, 0.02])
def test_a_moving_joint_is_contradicted_by_an_encoder_that_stands(deviation: float):
    logged = noisy(with_hinge(swinging(0.4), STAND), deviation)
    jammed, moving = with_hinge(swinging(0.4), STAND + 0.01), swinging(0.4)

    assert mean_loss(moving, logged) > 3 * mean_loss(jammed, logged)
    assert mean_loss(moving, logged) > 0.1


def test_an_encoder_in_steps_stands_between_two_of_them():
    logged = with_hinge(swinging(0.4), np.where(np.arange(STEPS) % 7, STAND, STAND + 0.01))
    jammed = with_hinge(swinging(0.4), STAND + 0.01)

    assert mean_loss(jammed, logged) < 0.02


def test_the_encoder_of_a_detached_joint_counts_neither_for_nor_against():
    for column in (STAND, swinging(0.4)[:, 0], swinging(0.4)[:, 1]):
        logged = with_hinge(swinging(0.4), column)
        detached = with_hinge(swinging(0.4), np.median(logged[STARTS, 0]))

        assert mean_loss(detached, logged) == pytest.approx(0, abs=1e-12)


def test_unknown_angles_are_no_evidence():
    logged = with_hinge(swinging(0.4), np.nan)

    assert mean_loss(with_hinge(swinging(0.4), STAND), logged) == 0
    assert mean_loss(swinging(0.4), np.full_like(logged, np.nan)) == 0
