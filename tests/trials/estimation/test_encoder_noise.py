"""Promises of the noise of encoders: that of the log, whatever the joint does."""

import numpy as np
import pytest

from selfmodel.trials.estimation.encoder_noise import PLAY, encoder_noise, standing_tolerance

STEPS = 1000
SWING = 0.4 * np.sin(np.arange(STEPS) * 0.01 * 2 * np.pi * 1.5)


@pytest.mark.parametrize("deviation", [0.003, 0.02])
@pytest.mark.parametrize("motion", [np.zeros(STEPS), SWING])
def test_white_noise_is_estimated_on_standing_and_on_moving_joints(
    motion: np.ndarray, deviation: float
):
    noise = np.random.default_rng(0).normal(0, deviation, STEPS)

    assert encoder_noise((motion + noise)[:, np.newaxis])[0] == pytest.approx(deviation, rel=0.15)


def test_a_swinging_joint_without_noise_has_next_to_none():
    assert encoder_noise(SWING[:, np.newaxis])[0] < 1e-3


def test_an_encoder_that_flickers_between_two_steps_has_the_noise_of_rounding():
    flickering = np.zeros((STEPS, 1))
    flickering[::50] = 0.02

    assert encoder_noise(flickering)[0] == pytest.approx(0.02 / np.sqrt(12))


def test_unknown_angles_are_left_out_and_a_column_without_angles_has_no_noise():
    angles = np.full((STEPS, 2), np.nan)
    angles[:, 0] = 0.3 + np.random.default_rng(0).normal(0, 0.01, STEPS)
    angles[::40, 0] = np.nan

    known, unknown = encoder_noise(angles)
    assert known == pytest.approx(0.01, rel=0.2)
    assert unknown == 0
    assert standing_tolerance(angles)[1] == PLAY
