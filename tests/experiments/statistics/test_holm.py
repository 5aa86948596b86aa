"""Tests of Holm's correction."""

import pytest
from hypothesis import given, strategies as st

from selfmodel.experiments.statistics.holm import holm

P_VALUES = st.lists(st.floats(0, 1), max_size=12)


def test_the_smallest_p_is_multiplied_by_the_number_of_tests_and_the_next_by_one_less():
    assert holm([0.04, 0.01, 0.02]) == pytest.approx([0.04, 0.03, 0.04])


def test_a_corrected_p_is_at_most_one_and_one_test_needs_no_correction():
    assert holm([0.6, 0.9]) == [1, 1]
    assert holm([0.03]) == [0.03]
    assert holm([]) == []


@given(P_VALUES)
def test_corrected_p_values_have_the_order_of_the_tests_and_are_never_smaller(values: list[float]):
    found = holm(values)
    ordered = [p for _, p in sorted(zip(values, found, strict=True))]

    assert ordered == sorted(ordered)
    assert all(new >= old for old, new in zip(values, found, strict=True))


@pytest.mark.parametrize("wrong", [float("nan"), -0.1, 1.1])
def test_a_number_that_is_no_p_is_refused(wrong: float):
    with pytest.raises(ValueError, match=r"expected .*p values"):
        holm([0.01, wrong])
