import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.spatial.transform import Rotation, Slerp

from selfmodel.logs.recordings.resample import angles, hold, linear, reach, slerp

periods = st.lists(st.integers(1, 50), min_size=1, max_size=30)
numbers = st.integers(-1000, 1000)


@st.composite
def series(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, values, and times to resample at, some of them on samples and some outside."""
    steps = draw(periods)
    times = np.concatenate([[0], np.cumsum(steps)]).astype(float)
    values = np.array(draw(st.lists(numbers, min_size=len(times), max_size=len(times)))) / 100
    at = draw(st.lists(st.integers(-20, int(times[-1]) * 2 + 20), min_size=1, max_size=40))
    return times, values[:, np.newaxis], np.sort(np.array(at)) / 2


def gaps(times: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Where nothing is known, in the plainest words."""
    periods = np.diff(times)
    unknown = []
    for t in at:
        before, after = times[times <= t], times[times >= t]
        if not len(before) or not len(after) or after[0] == before[-1]:
            unknown.append(not len(before) or not len(after))
            continue
        k, usual = len(before) - 1, [np.median(periods)]
        if len(periods) >= 25:
            usual += [np.median(periods[k:][:25] if k + 25 <= len(periods) else periods[-25:])]
            usual += [np.median(periods[: k + 1][-25:] if k >= 24 else periods[:25])]
        unknown.append(bool(after[0] - before[-1] > 1.5 * max(usual)))
    return np.array(unknown)


@given(series())
def test_between_samples_it_is_the_line_and_in_gaps_nothing(data: tuple):
    times, values, at = data
    result = linear(times, values, at, reach(times))[:, 0]
    unknown = gaps(times, at)
    assert np.array_equal(np.isnan(result), unknown)
    expected = np.interp(at, times, values[:, 0])
    assert np.allclose(result[~unknown], expected[~unknown], rtol=0, atol=1e-12)


@given(series())
def test_a_sample_has_its_own_value_at_its_own_time(data: tuple):
    times, values, _ = data
    for method in (linear, hold):
        assert np.array_equal(method(times, values, times, reach(times)), values)


@given(series())
def test_an_angle_that_wraps_goes_the_short_way(data: tuple):
    times, values, at = data
    slow = 0.3 * values.cumsum(axis=0) / np.abs(values).max(initial=1)
    wrapped = (slow + np.pi) % (2 * np.pi) - np.pi
    result = angles(times, wrapped, at, reach(times))
    expected = linear(times, slow, at, reach(times))
    assert np.array_equal(np.isnan(result), np.isnan(expected))
    assert np.allclose(np.cos(result - expected)[~np.isnan(result)], 1)


@given(series(), st.integers(0, 2**32 - 1))
def test_orientations_take_the_shortest_arc_whatever_their_signs(data: tuple, seed: int):
    times, _, at = data
    rng = np.random.default_rng(seed)
    turns = rng.normal(size=(len(times), 4))
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    result = slerp(times, turns, at, reach(times))
    unknown = gaps(times, at)
    assert np.array_equal(np.isnan(result).any(axis=1), unknown)
    assert np.allclose(np.linalg.norm(result[~unknown], axis=1), 1)
    signs = rng.choice([-1.0, 1.0], size=(len(times), 1))
    other = slerp(times, signs * turns, at, reach(times))
    same = np.abs(np.sum(result * other, axis=1))
    assert np.allclose(same[~unknown], 1)
    if not unknown.all():
        oracle = Slerp(times, Rotation.from_quat(turns, scalar_first=True))(at[~unknown])
        expected = oracle.as_quat(scalar_first=True)
        # At half a turn between two, either way round is the shortest.
        assert np.allclose(np.abs(np.sum(result[~unknown] * expected, axis=1)), 1)


RATES = {
    "first slow": [20] * 30 + [5] * 200,
    "then slow": [5] * 200 + [20] * 30,
    "two drivers": [2, 6] * 60,
}


@pytest.mark.parametrize("periods", RATES.values(), ids=RATES)
def test_nothing_is_a_gap_within_its_own_rate(periods: list[int]):
    lost = 80  # where the rate is the usual one: two samples are missing there
    times = np.cumsum([0, *periods[:lost], 3 * max(periods[lost - 5 : lost]), *periods[lost:]])
    silent = np.diff(times) > reach(times.astype(float))[:-1]
    assert np.flatnonzero(silent).tolist() == [lost]


def test_a_measurement_that_is_held_grows_too_old():
    times, values = np.array([0.0, 1.0, 2.0]), np.ones((3, 1))
    result = hold(times, values, np.array([-0.1, 0.0, 2.4, 3.5, 3.6]), reach(times))
    assert np.array_equal(np.isnan(result[:, 0]), [True, False, False, False, True])
