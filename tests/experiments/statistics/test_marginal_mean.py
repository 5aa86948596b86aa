"""Tests of marginal means."""

import dataclasses
import math

import pytest

from selfmodel.experiments.confidence_intervals import proportion
from selfmodel.experiments.statistics import Outcome, marginal_means
from tests.experiments.statistics.test_comparison import TABLE, outcomes


def test_cells_count_equally_however_many_runs_they_have():
    easy = [Outcome(TABLE, "a", ("easy",), seed, 1.0, "share") for seed in range(9)]
    hard = [Outcome(TABLE, "a", ("hard",), 0, 0.0, "share")]
    (found,) = marginal_means([*easy, *hard])

    assert found.mean.estimate == 0.5
    assert (found.runs, found.cells, found.seeds) == (10, 2, 9)


def test_cells_that_another_method_lacks_are_left_out():
    (first, second) = marginal_means([*outcomes("a", "11110000"), *outcomes("b", "0000")])

    assert (first.mean.estimate, first.runs, first.left_out) == (1, 4, 4)
    assert (second.mean.estimate, second.runs, second.left_out) == (0, 4, 0)


def test_of_one_cell_the_interval_contains_wilsons():
    (found,) = marginal_means(outcomes("a", "1101110111", seeds=10))
    wilson = proportion(8, 10)

    assert found.mean.low < wilson.low + 1e-9
    assert found.mean.high > wilson.high - 1e-9


def test_all_right_is_not_certain():
    (found,) = marginal_means(outcomes("a", "1" * 36))

    assert (found.mean.estimate, found.mean.high) == (1, 1)
    assert found.mean.low == pytest.approx(0.904, abs=0.001)  # Wilson's of 36 of 36


def test_a_mean_of_numbers_has_students_interval_over_seeds():
    rows = [Outcome(("m",), "a", ("x",), seed, float(seed), "number") for seed in range(4)]
    (found,) = marginal_means(rows)

    assert found.mean.estimate == 1.5
    assert found.mean.high - 1.5 == pytest.approx(3.182 * 1.291 / 2, rel=1e-3)
    (alone,) = marginal_means([dataclasses.replace(rows[0], value=0.3)])
    assert math.isnan(alone.mean.low)


def test_a_mean_of_metres_that_are_all_0_or_1_may_be_beyond_1():
    rows = [Outcome(("m",), "a", ("x",), seed, seed > 0, "number") for seed in range(4)]
    (metres,) = marginal_means(rows)
    (share,) = marginal_means([dataclasses.replace(one, measure="share") for one in rows])

    assert metres.mean.high > 1
    assert share.mean.high == 1
