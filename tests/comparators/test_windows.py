"""Tests of windows: the last is filled up with 0, and so is what was not observed."""

import numpy as np

from selfmodel.comparators.windows import masked_mean, padded_windows


def test_the_last_window_is_filled_up_with_zeros():
    values = np.arange(1.0, 11.0).reshape(1, 5, 2)
    windows = padded_windows(values, 3)

    assert windows.shape == (1, 2, 3, 2)
    assert windows[0, 0].tolist() == [[1, 2], [3, 4], [5, 6]]
    assert windows[0, 1].tolist() == [[7, 8], [9, 10], [0, 0]]


def test_unobserved_values_become_zeros():
    values = np.array([[1.0, np.nan], [2.0, 3.0]])

    assert padded_windows(values, 2, np.isfinite(values)).tolist() == [[[1, 0], [2, 3]]]


def test_a_masked_mean_is_over_the_mask_and_0_without_one():
    values = np.array([[1.0, 3.0, 8.0], [5.0, 5.0, 5.0]])
    mask = np.array([[True, True, False], [False, False, False]])

    assert masked_mean(values, mask).tolist() == [2, 0]
