"""Promises of the losses on encoders: whether they stand or move, and those of single hinges."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from selfmodel.comparators.encoders import encoder_motion_loss, hinge_losses, logged_motion
from selfmodel.trials.signals import HINGE_ERROR_SCALES, Signal
from selfmodel.trials.trajectory import Trajectory
from tests.helpers.gaits import gait

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


def mean_loss(predicted: np.ndarray, logged: np.ndarray, *, detaches: bool = False) -> float:
    """The mean loss of one prediction of angles ``(steps, hinges)``.

    A hinge that stands is welded, and the first one detached if the hypothesis detaches it.
    """
    stands = np.ptp(predicted, axis=0) == 0
    first = np.arange(HINGES) == 0
    simulated = Trajectory(
        gait().names,
        np.arange(HORIZON + 1) * 0.01,
        {"joint_positions": segments(predicted)[np.newaxis]},
        welded=(stands & ~(first & detaches))[np.newaxis],
        detached=(first & detaches)[np.newaxis],
    )
    return float(encoder_motion_loss(simulated, logged_motion(logged, STARTS, HORIZON)).mean())


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


def test_the_encoder_of_a_detached_joint_counts_neither_for_nor_against():
    for column in (STAND, swinging(0.4)[:, 0], swinging(0.4)[:, 1]):
        logged = with_hinge(swinging(0.4), column)
        detached = with_hinge(swinging(0.4), np.median(logged[STARTS, 0]))

        assert mean_loss(detached, logged, detaches=True) == pytest.approx(0, abs=1e-12)


SEGMENTS, STEP_COUNT, COLUMNS = 3, 12, 4
COMPARED = np.array([3, 6, 9, 12])
MOTION = np.linspace(0, 1, SEGMENTS * (STEP_COUNT + 1) * COLUMNS).reshape(1, SEGMENTS, -1, COLUMNS)


def predicted(
    positions: np.ndarray = MOTION,
    velocities: np.ndarray = MOTION,
    detached: np.ndarray | None = None,
) -> Trajectory:
    signals: dict[Signal, np.ndarray] = {
        "joint_positions": positions,
        "joint_velocities": velocities,
    }
    return Trajectory(gait().names, np.arange(STEP_COUNT + 1) * 0.01, signals, detached=detached)


def losses(
    prediction: Trajectory,
    positions: np.ndarray = MOTION,
    velocities: np.ndarray = MOTION,
) -> np.ndarray:
    logged: dict[Signal, np.ndarray] = {
        "joint_positions": positions[0][:, COMPARED],
        "joint_velocities": velocities[0][:, COMPARED],
    }
    return hinge_losses(prediction, logged, COMPARED)


def shifted(values: np.ndarray, hinge: int, change: float) -> np.ndarray:
    changed = values.copy()
    changed[..., hinge] += change
    return changed


@given(st.integers(0, COLUMNS - 1), st.floats(1e-3, 1))
def test_an_error_of_one_hinge_is_a_loss_of_this_hinge_alone(hinge: int, error: float):
    found = losses(predicted(shifted(MOTION, hinge, error)))

    expected = np.log1p((error / HINGE_ERROR_SCALES["joint_positions"]) ** 2)
    assert found[..., hinge] == pytest.approx(np.full((1, SEGMENTS), expected))
    assert not np.delete(found, hinge, axis=2).any()


def test_an_unknown_angle_is_no_evidence_and_an_unknown_velocity_leaves_the_angle():
    unknown = shifted(MOTION, 2, np.nan)

    assert np.isnan(losses(predicted(), positions=unknown)[..., 2]).all()
    assert losses(predicted(shifted(MOTION, 2, 0.1)), velocities=unknown)[..., 2].all()
    assert not np.isnan(losses(predicted(), velocities=unknown)).any()


def test_a_hinge_that_the_hypothesis_detaches_has_no_loss():
    lost = np.array([[False, True, False, False]])

    assert np.isnan(losses(predicted(detached=lost))).all(axis=(0, 1)).tolist() == lost[0].tolist()


def test_unknown_angles_are_no_evidence():
    logged = with_hinge(swinging(0.4), np.nan)

    assert mean_loss(with_hinge(swinging(0.4), STAND), logged) == 0
    assert mean_loss(swinging(0.4), np.full_like(logged, np.nan)) == 0
