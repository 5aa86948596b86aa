"""Promises of the rows: the restored share counts from the failing trial on."""

import math

import pytest

from selfmodel.experiments.paper.rows import best_so_far, run_of
from tests.helpers.paper_rows import recovery, trials


def test_the_best_recovery_trial_so_far_counts_and_the_failing_trial_only_as_the_first():
    found = best_so_far(trials([2.0, 1.5, 0.5, 0.2, 3.0]))

    assert found == pytest.approx([0.75, 0.25, 0.25, 1.5])


@pytest.mark.parametrize("before", [0.0, -1.0])
def test_a_robot_that_did_not_walk_forward_has_no_ratio(before: float):
    assert math.isnan(recovery(before=before).ratio)
    assert all(map(math.isnan, best_so_far(trials([before, 1.0, 1.0]))))


def test_a_run_is_a_robot_a_case_and_a_seed():
    assert run_of(recovery(robot="hexapod", case=4, seed=2)) == ("hexapod", 4, 2)
