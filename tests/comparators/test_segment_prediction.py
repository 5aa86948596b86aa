"""Promises of how ``segment-prediction`` judges readings: what is sure, and what contradicts."""

import numpy as np

from selfmodel.comparators import SEGMENT_PREDICTION
from selfmodel.comparators.segment_prediction import CONTRADICTION
from selfmodel.diagnosis.comparator_contract import shown
from selfmodel.trials.behaviour import Behaviour
from tests.helpers.gaits import changed, gait, logged

TOUCH = 0
"""The column of a sensor of touch."""


def losses(trial: Behaviour, readings: np.ndarray) -> np.ndarray:
    """The loss of each segment where only these readings, ``(segments, 13, 4)``, are predicted."""
    one = logged(trial)
    perfect = shown(SEGMENT_PREDICTION.prepare(one).request, one)
    signals = {**perfect.signals, "sensors": readings[np.newaxis]}
    found = Behaviour(perfect.names, perfect.time, signals)
    return SEGMENT_PREDICTION.prepare(one).losses(found)[0]


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
