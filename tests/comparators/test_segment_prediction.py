"""Promises of how ``segment-prediction`` judges readings: what is sure, and what contradicts."""

import numpy as np
from hypothesis import given, settings, strategies as st

from selfmodel.comparators import SEGMENT_PREDICTION
from selfmodel.comparators.encoders import encoder_motion_loss, logged_motion
from selfmodel.comparators.readings import CONTRADICTION
from selfmodel.testing import shown
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.estimation import JOINTS
from selfmodel.trials.signals import PREDICTION_ERROR_SCALES
from tests.helpers.gaits import changed, gait, logged

TOUCH = 0
"""The column of a sensor of touch."""


def losses(trial: Behaviour, readings: np.ndarray) -> np.ndarray:
    """The loss of each segment where only these readings, ``(segments, 13, 4)``, are predicted."""
    one = logged(trial)
    perfect = shown(SEGMENT_PREDICTION.prepare(one).request, one)
    signals = {**perfect.signals, "sensors": readings[np.newaxis]}
    found = Behaviour(perfect.names, perfect.time, signals)
    return SEGMENT_PREDICTION.prepare(one).losses(found).total[0]


def predicted(trial: Behaviour) -> np.ndarray:
    """The readings of a perfect prediction, ``(segments, 13, 4)``."""
    one = logged(trial)
    return shown(SEGMENT_PREDICTION.prepare(one).request, one)["sensors"][0].copy()


def test_a_touch_at_the_beginning_of_a_segment_is_judged_only_where_the_robot_stands():
    walking = gait()
    readings = predicted(walking)
    readings[:, 0, TOUCH] = 1 - readings[:, 0, TOUCH]

    found = losses(walking, readings)
    assert found[0] > 0
    assert not found[1:].any()


def test_an_angle_at_the_beginning_of_a_segment_is_judged_everywhere():
    walking = gait()
    sensors = walking["sensors"].copy()
    sensors[:, TOUCH] = 0.4
    graded = changed(walking, sensors=sensors)
    readings = predicted(graded)
    readings[:, 0, TOUCH] += 0.3

    assert (losses(graded, readings) > 0).all()


def test_a_touch_that_is_never_predicted_counts_three_times_where_it_comes():
    walking = gait()
    silent, late = predicted(walking), predicted(walking)
    silent[..., TOUCH] = 0
    # The same segments wrong in the same steps, but for one with a predicted touch.
    late[..., TOUCH] = 0
    far = int(np.flatnonzero(predicted(walking)[:, 1:, TOUCH].any(axis=1))[-1])
    late[far] = predicted(walking)[far]

    never, now_and_then = losses(walking, silent), losses(walking, late)
    others = np.arange(len(never)) != far
    assert never[others].sum() > 0
    np.testing.assert_allclose(never[others], CONTRADICTION * now_and_then[others], rtol=1e-12)
    assert CONTRADICTION == 3


def motion_loss(run: Behaviour, predicted: np.ndarray, hinges: np.ndarray) -> np.ndarray:
    """The loss of the motion of some encoders, ``(1, segments)``."""
    request = SEGMENT_PREDICTION.prepare(logged(run)).request
    angles = np.full_like(run["joint_positions"], np.nan)
    angles[:, hinges] = run["joint_positions"][:, hinges]
    time = run.time[: request.horizon + 1]
    simulated = Behaviour(run.names, time, {"joint_positions": predicted})
    return encoder_motion_loss(simulated, logged_motion(angles, request.starts, request.horizon))


@settings(max_examples=10, deadline=None)
@given(lost=st.integers(0, 3), seed=st.integers(0, 2**32))
def test_the_loss_without_an_encoder_is_that_of_the_other_columns(lost: int, seed: int):
    walking, others = gait(), [leg for leg in range(4) if leg != lost]
    joints = {signal: walking[signal].copy() for signal in JOINTS}
    for values in joints.values():
        values[:, lost] = np.nan
    trial = logged(changed(walking, **joints))
    prepared = SEGMENT_PREDICTION.prepare(trial)
    exact = shown(SEGMENT_PREDICTION.prepare(logged(walking)).request, logged(walking))
    rng = np.random.default_rng(seed)
    wrong = {signal: exact[signal] + rng.normal(0, 0.1, exact[signal].shape) for signal in JOINTS}
    simulated = Behaviour(exact.names, exact.time, {**exact.signals, **wrong})
    found = prepared.losses(simulated).total

    expected = np.zeros_like(found)
    for signal in JOINTS:
        steps = prepared.compared
        errors = (wrong[signal] - exact[signal])[:, :, steps][..., others]
        expected += np.log1p(np.square(errors / PREDICTION_ERROR_SCALES[signal])).mean(axis=(2, 3))
    expected += motion_loss(walking, wrong["joint_positions"], others)
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    assert not prepared.request.independent


def test_a_sensor_that_was_never_observed_has_no_loss_whatever_is_predicted():
    walking = gait()
    sensors = walking["sensors"].copy()
    sensors[:, TOUCH] = np.nan
    unseen = changed(walking, sensors=sensors)
    dead, noisy = predicted(walking), predicted(walking)
    dead[..., 1], noisy[..., 1] = 0.5, 0.5  # an error of another sensor
    dead[..., TOUCH] = 0
    noisy[..., TOUCH] = np.random.default_rng(0).normal(size=noisy.shape[:2])

    np.testing.assert_array_equal(losses(unseen, dead), losses(unseen, noisy))
