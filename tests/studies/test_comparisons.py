"""Comparisons of methods: pairs of the same run, corrected within a table; means over cells."""

import math

import pandas as pd
import pytest

from selfmodel.errors import InputError
from selfmodel.studies.comparisons import OUTCOME, balance_warnings, compare, marginal_means

TABLE = ("quadruped", "3 trials")


def frame(*rows: tuple) -> pd.DataFrame:
    return pd.DataFrame(list(rows), columns=list(OUTCOME))


def outcomes(method: str, values: str, seeds: int = 4, **changes: object) -> pd.DataFrame:
    """Outcomes of a method, right (1) or wrong (0), one case after another for each seed."""
    rows = [
        (TABLE, method, (f"case {place // seeds}",), place % seeds, float(value), "share")
        for place, value in enumerate(values)
    ]
    return frame(*rows).assign(**{name: [value] * len(rows) for name, value in changes.items()})


def joined(*frames: pd.DataFrame) -> pd.DataFrame:
    return pd.concat(frames, ignore_index=True)


def test_methods_are_compared_on_the_runs_that_both_have_whatever_their_order():
    # Of the four runs of the second seeds, which only "often" has, all are wrong.
    often = outcomes("often", "11110000" * 2, seeds=8)
    seldom = outcomes("seldom", "00010000" * 2, seeds=8)
    rows = joined(often, seldom[seldom["seed"] < 4])
    found = compare(rows).iloc[0]

    assert found[["first", "second", "n", "seeds"]].tolist() == ["often", "seldom", 8, 4]
    assert found[["first_mean", "second_mean", "difference"]].tolist() == [1, 0.25, 0.75]
    assert found[["only_first", "only_second"]].tolist() == [6, 0]
    assert found["p_runs"] == pytest.approx(2 / 2**6)
    pd.testing.assert_frame_equal(compare(rows), compare(rows[::-1]))
    apart = outcomes("b", "1111").assign(seed=lambda frame: frame["seed"] + 9)
    assert not len(compare(joined(outcomes("a", "1111"), apart)))


def test_every_pair_of_a_table_counts_in_its_correction_and_other_tables_do_not():
    # 12 seeds of a case: as many seeds as runs.
    own = [outcomes(name, v * 12, 12) for name, v in (("a", "1"), ("b", "0"), ("c", "0"))]
    other = [outcomes(name, v * 12, 12, table=("hexapod",)) for name, v in (("a", "1"), ("b", "0"))]
    found = compare(joined(*own, *other))
    by_pair = {(row.table[0], row.first, row.second): row for row in found.itertuples()}

    alone, first, second = (
        by_pair[key]
        for key in (("hexapod", "a", "b"), ("quadruped", "a", "b"), ("quadruped", "b", "c"))
    )
    assert len(found) == 4
    assert alone.p_holm == alone.p_runs == pytest.approx(2 / 2**12)
    assert (first.p_holm, second.p_holm) == (pytest.approx(3 * 2 / 2**12), 1)
    assert (first.better, second.better) == ("a", None)


def test_a_difference_that_one_seed_makes_is_not_called_better():
    # Twelve of twelve cases, all in one seed of four: McNemar's test alone would be sure.
    found = compare(joined(outcomes("a", "1000" * 12), outcomes("b", "0" * 48))).iloc[0]

    assert found["p_runs"] < 0.001
    assert found["difference_low"] < 0
    assert found["p_holm"] == found["p_seeds"] == pytest.approx(0.391, abs=0.001)
    assert found["better"] is None


def test_three_seeds_that_agree_in_every_run_decide_nothing():
    found = compare(joined(outcomes("a", "1" * 27, 3), outcomes("b", "0" * 27, 3))).iloc[0]

    assert found[["n", "seeds", "only_first"]].tolist() == [27, 3, 27]
    assert found["p_runs"] < 1e-7
    assert found["p_holm"] == found["p_seeds"] == 0.25
    assert found["better"] is None


def test_numbers_are_compared_by_their_signs_and_their_seeds():
    rows = [
        (("m",), name, (f"case {case}",), seed, value + 0.1 * seed * case, "number")
        for name, value in {"far": 3.0, "near": 1.0}.items()
        for case in (1, 2)
        for seed in range(6)
    ]
    found = compare(frame(*rows)).iloc[0]

    assert found["difference"] == pytest.approx(2)
    assert found["p_runs"] == pytest.approx(2 / 2**12)
    assert found["p_seeds"] == 2 / 2**6  # equal differences in every seed
    assert found["better"] == "far"
    # Of numbers, no run contradicts a difference of 1; of shares, a rarer error may be unseen.
    shares = joined(outcomes("a", "111" * 2, 3), outcomes("b", "000" * 2, 3))
    exact = compare(shares.assign(measure="number")).iloc[0]
    assert (exact["difference_low"], exact["difference_high"]) == (1, 1)
    assert compare(shares).iloc[0]["difference_low"] < 1


@pytest.mark.parametrize(
    ("value", "measure", "expected"),
    [(math.nan, "number", "a finite value"), (0.5, "share", "1 or 0")],
)
def test_an_outcome_without_a_value_of_its_measure_is_refused(
    value: float, measure: str, expected: str
):
    rows = frame((("m",), "a", ("case 1",), 0, value, measure))

    for function in (compare, marginal_means):
        with pytest.raises(InputError, match=f"expected {expected}.* of a in m, case 1, seed 0"):
            function(rows)


def test_a_table_has_one_measure_and_a_run_counts_once():
    rows = joined(outcomes("a", "1101"), outcomes("b", "0100"))

    with pytest.raises(InputError, match="one outcome of a in quadruped, 3 trials, case 0, seed 0"):
        compare(joined(rows, rows[:1]))
    with pytest.raises(InputError, match="expected one measure in the table quadruped, 3 trials"):
        compare(joined(rows, outcomes("c", "0100", measure="number")))


def test_cells_count_equally_however_many_runs_they_have():
    easy = [(TABLE, "a", ("easy",), seed, 1.0, "share") for seed in range(9)]
    found = marginal_means(frame(*easy, (TABLE, "a", ("hard",), 0, 0.0, "share"))).iloc[0]

    assert found[["mean", "n", "cells", "seeds"]].tolist() == [0.5, 10, 2, 9]


def test_cells_that_another_method_lacks_are_left_out():
    found = marginal_means(joined(outcomes("a", "11110000"), outcomes("b", "0000")))

    assert found[["mean", "n", "left_out"]].to_numpy().tolist() == [[1, 4, 4], [0, 4, 0]]


def test_a_mean_of_shares_has_wilsons_interval_at_least_and_of_numbers_students():
    every = marginal_means(outcomes("a", "1" * 36)).iloc[0]
    rows = frame(*((("m",), "a", ("x",), seed, float(seed), "number") for seed in range(4)))
    found, alone = marginal_means(rows).iloc[0], marginal_means(rows[:1]).iloc[0]

    assert (every["mean"], every["mean_high"]) == (1, 1)
    assert every["mean_low"] == pytest.approx(0.904, abs=0.001)  # Wilson's of 36 of 36
    assert found["mean"] == 1.5
    assert found["mean_high"] - 1.5 == pytest.approx(3.182 * 1.291 / 2, rel=1e-3)
    assert math.isnan(alone["mean_low"])


def test_a_study_without_outcomes_has_neither_means_nor_pairs():
    assert not len(compare(frame()))
    assert not len(marginal_means(frame()))
    assert balance_warnings(frame()) == ()


def test_unbalanced_tables_are_named_with_their_numbers_of_runs():
    more = [outcomes("a", "1" * 24, seeds=12), outcomes("b", "1" * 8)]
    other = [rows.assign(table=[("hexapod",)] * len(rows)) for rows in more]
    (warning,) = balance_warnings(joined(*more, *other))
    assert warning.startswith("quadruped, 3 trials; hexapod: the cells are unbalanced (runs: a 24,")

    both = joined(outcomes("a", "11110000"), outcomes("b", "01010101"))
    assert balance_warnings(both) == ()
    (warning,) = balance_warnings(both[(both["cell"] != ("case 1",)) | (both["seed"] < 2)])
    assert "(runs: a 6, b 6, not the same ones)" in warning
    apart = outcomes("b", "1111").assign(seed=lambda rows: rows["seed"] + 4)
    assert len(balance_warnings(joined(outcomes("a", "1111"), apart))) == 1
