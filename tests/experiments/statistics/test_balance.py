"""Tests of the warning about unbalanced cells."""

import dataclasses

from selfmodel.experiments.statistics import balance_warnings, imbalances
from tests.experiments.statistics.test_comparison import outcomes


def test_methods_with_the_same_runs_are_balanced():
    assert imbalances([*outcomes("a", "11110000"), *outcomes("b", "01010101")]) == ()


def test_a_method_with_more_seeds_makes_a_table_unbalanced():
    (found,) = imbalances([*outcomes("a", "1" * 24, seeds=12), *outcomes("b", "1" * 8)])

    assert found.runs == {"a": 24, "b": 8}
    assert found.missing == {"a": 0, "b": 16}
    (warning,) = balance_warnings([found, dataclasses.replace(found, table=("hexapod",))])
    assert warning.startswith(
        "quadruped, 3 trials; hexapod: the cells are unbalanced (runs: a 24, b 8)"
    )


def test_a_cell_with_fewer_runs_than_another_makes_a_table_unbalanced():
    both = [*outcomes("a", "11110000"), *outcomes("b", "11110000")]
    (found,) = imbalances([one for one in both if one.cell != ("case 1",) or one.seed < 2])

    assert found.cells == {"a": (2, 4), "b": (2, 4)}
    assert "a 6 (2 to 4 per cell)" in found.counts


def test_the_same_number_of_other_runs_is_unbalanced_too():
    apart = [dataclasses.replace(one, seed=one.seed + 4) for one in outcomes("b", "1111")]

    (warning,) = balance_warnings(imbalances([*outcomes("a", "1111"), *apart]))
    assert "(runs: a 4, b 4, not the same runs): compare paired differences" in warning
