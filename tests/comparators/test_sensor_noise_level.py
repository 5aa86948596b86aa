"""Promises of the judgement of noise: single sensors, by how much, and nothing else."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from selfmodel.comparators.readings import MARGIN, ORDER, noise_level_loss

SEGMENTS, ROWS, SENSORS = 80, 13, 4
ALL = np.ones((1, SENSORS), dtype=bool)


def moving(radians_per_step: float) -> np.ndarray:
    """Readings of sensors that swing from end to end of their range, each out of step."""
    step = np.arange(SEGMENTS)[:, np.newaxis] * 7.3 + np.arange(ROWS)
    return np.sin(radians_per_step * step[..., np.newaxis] + np.arange(SENSORS))


def noisy(readings: np.ndarray, *deviations: float, seed: int = 0) -> np.ndarray:
    """The readings with noise."""
    return readings + np.random.default_rng(seed).normal(size=readings.shape) * deviations


def loss(predicted: np.ndarray, logged: np.ndarray, graded: np.ndarray = ALL) -> float:
    """Of one prediction."""
    return float(noise_level_loss(predicted[np.newaxis], logged, graded)[0])


@given(st.integers(0, 99), st.floats(0, 0.8))
def test_a_prediction_that_trembles_as_the_log_does_is_at_0(seed: int, deviation: float):
    logged = noisy(moving(0.1), 0, 0, 0, deviation, seed=seed)

    assert loss(logged, logged) == 0


@pytest.mark.parametrize("deviation", [0.2, 0.3, 0.6])
def test_the_right_noise_of_the_right_sensor_is_nearest(deviation: float):
    logged = noisy(moving(0.1), 0.05, 0.05, 0.05 + deviation, 0.05)
    predicted = {
        "right": noisy(moving(0.1), 0, 0, deviation, 0, seed=1),
        "none": moving(0.1),
        "twice": noisy(moving(0.1), 0, 0, 2 * deviation, 0, seed=1),
        "other": noisy(moving(0.1), 0, 0, 0, deviation, seed=1),
    }
    losses = {name: loss(one, logged) for name, one in predicted.items()}

    assert losses["right"] < losses["none"] / 2
    assert losses["right"] < losses["twice"] / 2
    assert losses["none"] < losses["other"]


@pytest.mark.parametrize("radians_per_step", [0.02, 0.3, 0.6])
def test_a_joint_that_swings_alone_is_no_noisy_one_up_to_ten_steps_a_swing(
    radians_per_step: float,
):
    logged = moving(radians_per_step)
    logged[..., 1:] = 0

    assert loss(np.zeros((SEGMENTS, ROWS, SENSORS)), logged) == 0


def test_segments_too_short_to_tremble_in_have_no_loss():
    logged = noisy(moving(0.1), 0, 0, 0.5, 0)

    assert loss(moving(0.1)[:, :ORDER], logged[:, :ORDER]) == 0
    assert loss(moving(0.1)[:, : ORDER + 1], logged[:, : ORDER + 1]) > 0


@pytest.mark.parametrize("level", [0.05, 0.2])
def test_noise_that_all_instruments_have_is_no_fault(level: float):
    assert loss(moving(0.1), noisy(moving(0.1), level, level, level, level)) == 0


def test_a_sensor_that_is_dead_among_noisy_ones_does_not_make_them_faulty():
    assert loss(moving(0.1), noisy(moving(0.1), 0, 0.2, 0.2, 0.2)) == 0


def test_an_impact_is_no_noise():
    logged = moving(0.1)
    logged[::3, 6:, 2] += 1

    assert loss(moving(0.1), logged) == 0


def test_what_was_not_received_does_not_count():
    whole = noisy(moving(0.1), 0.05, 0.05, 0.4, 0.05)
    holes = whole.copy()
    holes[::2, :, 2] = np.nan
    never = np.full_like(whole, np.nan)

    assert loss(moving(0.1), holes) == pytest.approx(loss(moving(0.1), whole), rel=0.1)
    assert loss(moving(0.1), never) == 0


def test_sensors_of_yes_and_no_have_no_noise():
    logged = noisy(moving(0.1), 0, 0, 0.5, 0)

    assert loss(moving(0.1), logged) > 0
    assert loss(moving(0.1), logged, np.array([[True, True, False, True]])) == 0


def test_of_a_single_sensor_nobody_knows_what_is_usual():
    one = np.zeros((1, SENSORS), dtype=bool)
    one[0, 2] = True

    assert loss(moving(0.1), noisy(moving(0.1), 0, 0, 0.5, 0), one) == 0


def test_less_than_the_least_is_none():
    logged = noisy(moving(0.05), 0, 0, 0.7 * MARGIN, 0)

    assert loss(moving(0.05), logged) == 0


def test_a_robot_without_sensors_has_no_noise():
    readings = np.zeros((SEGMENTS, ROWS, 0))

    assert loss(readings, readings, np.ones((1, 0), dtype=bool)) == 0
