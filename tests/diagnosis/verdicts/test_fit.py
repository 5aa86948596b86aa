"""Tests of the numbers behind a verdict."""

import json
import math

import pytest
from hypothesis import given, strategies as st

from selfmodel.diagnosis.verdicts.fit import FAULTY_RATIO, Fit
from selfmodel.diagnosis.verdicts.significance import LOSS_RATIO

NUMBERS = st.just(math.inf) | st.floats(0, 1e9)


def test_the_share_that_is_left_is_that_of_the_loss_beyond_the_reference():
    fit = Fit(
        loss=0.4, intact_loss=1.1, healthy_loss=0.1, excess=2.0, threshold=5.0, has_faults=True
    )

    assert fit.left == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("loss", "left"), [(0.05, 0.0), (0.1, 0.0), (1.1, 1.0), (2.0, 1.0), (math.inf, 1.0)]
)
def test_the_share_that_is_left_is_between_0_and_1(loss: float, left: float):
    assert Fit(loss, 1.1, 0.1, 0.0, 5.0, has_faults=True).left == left


@pytest.mark.parametrize(("intact", "healthy"), [(1.0, None), (0.1, 0.1), (0.1, 0.2)])
def test_without_a_loss_beyond_the_reference_no_share_is_left(intact: float, healthy: float | None):
    assert Fit(0.5, intact, healthy, 0.0, 5.0, has_faults=True).left is None


@pytest.mark.parametrize(
    ("loss", "excess", "has_faults", "unexplained"),
    [
        (LOSS_RATIO * 0.99, 0.0, False, False),
        (LOSS_RATIO * 1.01, 0.0, False, True),
        (LOSS_RATIO * 1.01, 0.0, True, True),
        (1.1, 4.9, False, False),
        (1.1, 5.1, False, True),
        (1.1, math.inf, True, False),
        (FAULTY_RATIO * 1.01, 5.1, True, True),
        (FAULTY_RATIO * 1.01, 4.9, True, False),
    ],
)
def test_a_loss_is_unexplained_if_it_is_significant_and_for_faults_large(
    loss: float, excess: float, *, has_faults: bool, unexplained: bool
):
    assert Fit(loss, 9.0, 1.0, excess, 5.0, has_faults).is_unexplained == unexplained


def test_without_healthy_trials_nothing_is_unexplained():
    assert not Fit(9.0, 9.0, None, None, 5.0, has_faults=False).is_unexplained


@pytest.mark.parametrize("joints", [{}, {"front_left_knee": 4.1}])
def test_a_robot_with_a_joint_that_moves_otherwise_is_not_intact(joints: dict[str, float]):
    fit = Fit(1.0, 1.0, 1.0, 0.0, 3.5, has_faults=False, joints=joints)

    assert fit.is_unexplained == bool(joints)
    assert fit.to_dict()["joints"] == joints


@given(NUMBERS, NUMBERS, st.none() | NUMBERS, st.none() | NUMBERS)
def test_the_json_has_no_infinite_number(
    loss: float, intact: float, healthy: float | None, excess: float | None
):
    values = Fit(loss, intact, healthy, excess, 5.0, has_faults=False).to_dict()

    assert json.loads(json.dumps(values, allow_nan=False)) == values
    assert values["loss"] == (None if math.isinf(loss) else loss)
    assert set(values) == {
        *("loss", "intact_loss", "healthy_loss", "excess", "threshold", "has_faults", "left"),
        "joints",
    }
