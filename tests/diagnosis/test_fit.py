"""Tests of the numbers behind a verdict."""

import json
import math

import pytest
from hypothesis import given, strategies as st

from selfmodel.diagnosis.fit import Fit

NUMBERS = st.floats(0, allow_infinity=True)


def test_the_share_that_is_left_is_that_of_the_loss_beyond_the_reference():
    fit = Fit(loss=0.4, intact_loss=1.1, healthy_loss=0.1, excess=2.0, threshold=5.0)

    assert fit.left == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("loss", "left"), [(0.05, 0.0), (0.1, 0.0), (1.1, 1.0), (2.0, 1.0), (math.inf, 1.0)]
)
def test_the_share_that_is_left_is_between_0_and_1(loss: float, left: float):
    assert Fit(loss, 1.1, 0.1, 0.0, 5.0).left == left


@pytest.mark.parametrize(("intact", "healthy"), [(1.0, None), (0.1, 0.1), (0.1, 0.2)])
def test_without_a_loss_beyond_the_reference_no_share_is_left(intact: float, healthy: float | None):
    assert Fit(0.5, intact, healthy, 0.0, 5.0).left is None


@pytest.mark.parametrize(
    ("excess", "unexplained"),
    [(None, False), (0.0, False), (5.0, False), (5.1, True), (math.inf, True)],
)
def test_a_loss_is_unexplained_above_the_threshold(excess: float | None, *, unexplained: bool):
    healthy = None if excess is None else 0.1

    assert Fit(1.0, 2.0, healthy, excess, 5.0).is_unexplained == unexplained


@given(NUMBERS, NUMBERS, st.none() | NUMBERS, st.none() | NUMBERS)
def test_the_json_has_no_infinite_number(
    loss: float, intact: float, healthy: float | None, excess: float | None
):
    values = Fit(loss, intact, healthy, excess, 5.0).to_dict()

    assert json.loads(json.dumps(values, allow_nan=False)) == values
    assert values["loss"] == (None if math.isinf(loss) else loss)
    assert set(values) == {"loss", "intact_loss", "healthy_loss", "excess", "threshold", "left"}
