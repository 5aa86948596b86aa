"""Tests of the signals and the time in which loss is left."""

import numpy as np

from selfmodel.diagnosis.verdicts.change_point import Timeline
from selfmodel.diagnosis.verdicts.residual import WINDOW, residual_of

PIECES = 30
TIMELINE = Timeline(
    np.repeat([0, 1], [10, 20]),
    np.concatenate([np.arange(10) * 0.1, np.arange(20) * 0.1]),
    np.concatenate([np.arange(10) * 0.1, np.arange(20) * 0.1]) + 0.1,
)
NAMES = ("first", "second")


def test_the_signals_with_the_largest_excess_over_healthy_trials_are_named():
    losses = np.ones(PIECES)
    signals = {"a": 0.5, "b": 0.4, "c": 0.3, "d": 0.2, "e": 0.1}
    found = residual_of(signals, {"a": 0.45, "b": 0.1, "e": 0.2}, losses, TIMELINE, NAMES)

    assert found is not None
    assert list(found.signals) == ["b", "c", "d"]
    np.testing.assert_allclose(list(found.signals.values()), [0.3, 0.3, 0.2])


def test_the_worst_time_is_that_of_the_neighbouring_pieces_with_the_largest_loss():
    losses = np.full(PIECES, 0.1)
    losses[15 : 15 + WINDOW] = 1.0
    found = residual_of({"a": 0.5}, {}, losses, TIMELINE, NAMES)

    assert found is not None
    assert found.trial == "second"
    np.testing.assert_allclose((found.begin, found.end), (0.5, 0.5 + WINDOW * 0.1))


def test_the_worst_time_ends_with_its_trial():
    losses = np.zeros(PIECES)
    losses[8:12] = 1.0
    losses[7] = 0.5
    found = residual_of({"a": 0.5}, {}, losses, TIMELINE, NAMES)

    assert found is not None
    assert found.end <= (1.0 if found.trial == "first" else 2.0)
    assert found.begin < found.end


def test_there_is_no_residual_without_signals_or_with_a_diverged_loss():
    assert residual_of({}, {}, np.ones(PIECES), TIMELINE, NAMES) is None
    assert residual_of({"a": 0.1}, {"a": 0.2}, np.ones(PIECES), TIMELINE, NAMES) is None
    diverged = np.full(PIECES, np.inf)
    assert residual_of({"a": 0.5}, {}, diverged, TIMELINE, NAMES) is None
