"""Comparisons of methods: pairs of the same run, corrected within a table; means over cells."""

import math

import pandas as pd
import pytest

from selfmodel.errors import InputError
from selfmodel.studies.comparisons import OUTCOME, balance_warnings, compare, marginal_means
from selfmodel.studies.statistics import proportion

TABLE = ("quadruped", "3 trials")


def frame(*rows: tuple) -> pd.DataFrame:
    return pd.DataFrame(list(rows), columns=list(OUTCOME))


def outcomes(method: str, values: str, seeds: int = 4, **changes: object) -> pd.DataFrame:
    """Outcomes of a method, right (1) or wrong (0), one case after another for each seed."""
    rows = [
        (TABLE, method, (f"case {place // seeds}",), place % seeds, float(value), "share")
        for place, value in enumerate(values)
    ]
    found = frame(*rows)
    for name, value in changes.items():
        found[name] = [value] * len(found)
    return found


def joined(*frames: pd.DataFrame) -> pd.DataFrame:
    return pd.concat(frames, ignore_index=True)


def numbers(values: dict[str, float], seeds: int, measure: str = "number") -> pd.DataFrame:
    rows = [
        (("m",), name, (f"case {case}",), seed, value + 0.1 * seed * case, measure)
        for name, value in values.items()
        for case in (1, 2)
        for seed in range(seeds)
    ]
    return frame(*rows)


def test_methods_are_compared_on_the_runs_that_both_have():
    # Of the four runs of the second seeds, which only "often" has, all are wrong.
    often = outcomes("often", "11110000" * 2, seeds=8)
    seldom = outcomes("seldom", "00010000" * 2, seeds=8)
    found = compare(joined(often, seldom[seldom["seed"] < 4])).iloc[0]

    assert (found["first"], found["second"]) == ("often", "seldom")
    assert (found["n"], found["seeds"]) == (8, 4)
    assert (found["first_mean"], found["second_mean"], found["difference"]) == (1, 0.25, 0.75)
    assert (found["only_first"], found["only_second"]) == (6, 0)
    assert found["p_runs"] == pytest.approx(2 / 2**6)


def test_every_pair_of_a_table_counts_in_its_correction_and_other_tables_do_not():
    own = [outcomes(name, values * 12) for name, values in (("a", "1"), ("b", "0"), ("c", "0"))]
    other = [outcomes(name, v * 12, table=("hexapod",)) for name, v in (("a", "1"), ("b", "0"))]
    found = compare(joined(*own, *other))
    by_pair = {(row.table[0], row.first, row.second): row for row in found.itertuples()}

    assert len(found) == 4
    alone = by_pair["hexapod", "a", "b"]
    assert alone.p_holm == alone.p_runs == pytest.approx(2 / 2**12)
    assert by_pair["quadruped", "a", "b"].p_holm == pytest.approx(3 * 2 / 2**12)
    assert by_pair["quadruped", "b", "c"].p_holm == 1
    assert by_pair["quadruped", "a", "b"].better == "a"
    assert by_pair["quadruped", "b", "c"].better is None


def test_a_difference_that_one_seed_makes_is_not_called_better():
    # Twelve of twelve cases, all in one seed of four: McNemar's test alone would be sure.
    found = compare(joined(outcomes("a", "1000" * 12), outcomes("b", "0" * 48))).iloc[0]

    assert found["p_runs"] < 0.001
    assert found["difference_low"] < 0
    assert found["p_holm"] == found["p_seeds"] == pytest.approx(0.391, abs=0.001)
    assert found["better"] is None


def test_numbers_are_compared_by_their_signs_and_their_seeds():
    found = compare(numbers({"far": 3.0, "near": 1.0}, 6)).iloc[0]

    assert found["difference"] == pytest.approx(2)
    assert found["p_runs"] == pytest.approx(2 / 2**12)
    assert found["p_seeds"] < 1e-6
    assert found["better"] == "far"


def test_the_order_of_the_outcomes_does_not_matter_and_a_run_counts_once():
    rows = joined(outcomes("a", "1101" * 6), outcomes("b", "0100" * 6))

    pd.testing.assert_frame_equal(compare(rows), compare(rows[::-1]))
    with pytest.raises(InputError, match="one outcome of a in quadruped, 3 trials, case 0, seed 0"):
        compare(joined(rows, rows[:1]))


def test_methods_without_a_common_run_are_not_compared():
    apart = outcomes("b", "1111").assign(seed=lambda rows: rows["seed"] + 9)

    assert not len(compare(joined(outcomes("a", "1111"), apart)))


@pytest.mark.parametrize(
    ("value", "measure", "expected"),
    [
        *((math.nan, "number", "a finite value"), (math.inf, "number", "a finite value")),
        *((0.5, "share", "1 or 0"), (math.nan, "share", "1 or 0")),
    ],
)
def test_an_outcome_without_a_value_of_its_measure_is_refused(
    value: float, measure: str, expected: str
):
    rows = frame((("m",), "a", ("case 1",), 0, value, measure))

    for function in (compare, marginal_means):
        with pytest.raises(InputError, match=f"expected {expected}.* of a in m, case 1, seed 0"):
            function(rows)


def test_a_table_has_one_measure():
    rows = joined(outcomes("a", "1101"), outcomes("b", "0100", measure="number"))

    with pytest.raises(InputError, match="expected one measure in the table quadruped, 3 trials"):
        compare(rows)


def test_numbers_that_are_all_0_or_1_are_numbers():
    metres = joined(outcomes("a", "111" * 2, 3), outcomes("b", "000" * 2, 3))
    right = compare(metres).iloc[0]
    in_metres = compare(metres.assign(measure="number")).iloc[0]

    # All differences are 1 m: no run contradicts it. Of proportions, a rarer error may be unseen.
    assert (in_metres["difference_low"], in_metres["difference_high"]) == (1, 1)
    assert right["difference_low"] < 1


def test_cells_count_equally_however_many_runs_they_have():
    easy = [(TABLE, "a", ("easy",), seed, 1.0, "share") for seed in range(9)]
    found = marginal_means(frame(*easy, (TABLE, "a", ("hard",), 0, 0.0, "share"))).iloc[0]

    assert found["mean"] == 0.5
    assert (found["n"], found["cells"], found["seeds"]) == (10, 2, 9)


def test_cells_that_another_method_lacks_are_left_out():
    found = marginal_means(joined(outcomes("a", "11110000"), outcomes("b", "0000")))

    assert found[["mean", "n", "left_out"]].to_numpy().tolist() == [[1, 4, 4], [0, 4, 0]]


def test_of_one_cell_the_interval_contains_wilsons_and_all_right_is_not_certain():
    some = marginal_means(outcomes("a", "1101110111", seeds=10)).iloc[0]
    every = marginal_means(outcomes("a", "1" * 36)).iloc[0]
    wilson = proportion(8, 10)

    assert some["mean_low"] < wilson.low + 1e-9
    assert some["mean_high"] > wilson.high - 1e-9
    assert (every["mean"], every["mean_high"]) == (1, 1)
    assert every["mean_low"] == pytest.approx(0.904, abs=0.001)  # Wilson's of 36 of 36


def test_a_mean_of_numbers_has_students_interval_over_seeds():
    rows = frame(*((("m",), "a", ("x",), seed, float(seed), "number") for seed in range(4)))
    found, alone = marginal_means(rows).iloc[0], marginal_means(rows[:1]).iloc[0]

    assert found["mean"] == 1.5
    assert found["mean_high"] - 1.5 == pytest.approx(3.182 * 1.291 / 2, rel=1e-3)
    assert math.isnan(alone["mean_low"])


def test_a_study_without_outcomes_has_neither_means_nor_pairs():
    assert not len(compare(frame()))
    assert not len(marginal_means(frame()))
    assert balance_warnings(frame()) == ()


def test_methods_with_the_same_runs_are_balanced():
    assert balance_warnings(joined(outcomes("a", "11110000"), outcomes("b", "01010101"))) == ()


def test_unbalanced_tables_are_named_with_their_numbers_of_runs():
    more = [outcomes("a", "1" * 24, seeds=12), outcomes("b", "1" * 8)]
    other = [rows.assign(table=[("hexapod",)] * len(rows)) for rows in more]
    (warning,) = balance_warnings(joined(*more, *other))
    assert warning.startswith(
        "quadruped, 3 trials; hexapod: the cells are unbalanced (runs: a 24, b 8)"
    )

    both = joined(outcomes("a", "11110000"), outcomes("b", "11110000"))
    (warning,) = balance_warnings(both[(both["cell"] != ("case 1",)) | (both["seed"] < 2)])
    assert "a 6 (2 to 4 per cell)" in warning

    apart = outcomes("b", "1111").assign(seed=lambda rows: rows["seed"] + 4)
    (warning,) = balance_warnings(joined(outcomes("a", "1111"), apart))
    assert "(runs: a 4, b 4, not the same runs): compare paired differences" in warning
