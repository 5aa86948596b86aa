"""The sequential test: its recursion, and changes that are dated and shown by a channel."""

import numpy as np
import pytest

from selfmodel.watching.detector import Detector


def harmonic(rng: np.random.Generator, channels: int, healthy: int = 100) -> np.ndarray:
    """Logarithms of e-values of scores that are ranked among healthy ones of their own."""
    ranks = rng.integers(1, healthy + 2, channels)
    return np.log((healthy + 1) / (ranks * np.sum(1 / np.arange(1, healthy + 2))))


@pytest.mark.parametrize("channels", [1, 10])
def test_e_values_that_are_valid_given_all_before_alarm_as_seldom_as_stated(channels: int):
    rng, lengths = np.random.default_rng(0), []
    for _ in range(60):
        detector, length = Detector(run_length=40), 1
        while not detector.update(harmonic(rng, channels)):
            length += 1
        lengths.append(length)

    assert np.mean(lengths) >= 40


def test_a_change_of_one_channel_is_noticed_dated_and_shown():
    rng, detector = np.random.default_rng(1), Detector(run_length=30_000)
    for _ in range(100):
        assert not detector.update(harmonic(rng, 20))
    seen = 0
    while True:
        log_e = harmonic(rng, 20)
        log_e[7] = np.log(101 / np.sum(1 / np.arange(1, 102)))  # larger than all healthy scores
        seen += 1
        if detector.update(log_e):
            break
    onset = detector.onset()

    assert seen <= 5
    assert onset.newest <= seen - 1 <= onset.oldest < seen + 10
    assert onset.newest <= onset.age <= onset.oldest
    assert detector.shown_by() == [7]
