"""Tests of parts of a trial in time."""

import math

import numpy as np

from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.trial_part import TrialPart, whole
from tests.helpers.gaits import gait, logged

TRIAL = logged(gait(steps=200))


def test_a_part_has_the_rows_between_its_times_with_both_ends():
    rows = TrialPart(TRIAL, 0.5, 1.0).rows

    np.testing.assert_array_equal(rows.behaviour.time, TRIAL.behaviour.time[50:101])
    for signal, values in TRIAL.behaviour.signals.items():
        np.testing.assert_array_equal(rows.behaviour[signal], values[50:101])
    assert (rows.plan, rows.path) == (TRIAL.plan, TRIAL.path)


def test_late_steps_stay_with_their_rows():
    behaviour = TRIAL.behaviour
    late = np.zeros(200, dtype=bool)
    late[60] = True
    own = logged(Behaviour(behaviour.names, behaviour.time, behaviour.signals, late))
    rows = TrialPart(own, 0.5, 1.0).rows

    assert rows.behaviour.late is not None
    assert np.flatnonzero(rows.behaviour.late).tolist() == [10]


def test_a_part_is_whole_only_without_any_bound():
    assert whole(TRIAL).is_whole
    assert whole(TRIAL).rows.behaviour.steps == 200
    part = TrialPart(TRIAL, begin=0.0)
    assert whole(part) is part
    assert not part.is_whole
    assert not TrialPart(TRIAL, end=math.nextafter(math.inf, 0)).is_whole
