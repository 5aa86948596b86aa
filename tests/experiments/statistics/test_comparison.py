"""Tests of comparisons: pairs of the same run, corrected within a table."""

import dataclasses

import pytest

from selfmodel.errors import InputError
from selfmodel.experiments.statistics import Outcome, compare

TABLE = ("quadruped", "3 trials")


def outcomes(
    method: str, values: str, seeds: int = 4, table: tuple[str, ...] = TABLE
) -> list[Outcome]:
    """Outcomes of a method, right (1) or wrong (0), one case after another for each seed."""
    return [
        Outcome(table, method, (f"case {place // seeds}",), place % seeds, float(value), "share")
        for place, value in enumerate(values)
    ]


def test_methods_are_compared_on_the_runs_that_both_have():
    # Of the four runs of the second seeds, which only "often" has, all are wrong.
    often = outcomes("often", "11110000" * 2, seeds=8)
    seldom = [one for one in outcomes("seldom", "00010000" * 2, seeds=8) if one.seed < 4]
    (found,) = compare([*often, *seldom])

    assert (found.first, found.second) == ("often", "seldom")
    assert (found.runs, found.seeds) == (8, 4)
    assert (found.first_mean, found.second_mean) == (1, 0.25)
    assert found.difference.estimate == 0.75
    assert (found.only_first, found.only_second) == (6, 0)
    assert found.p_runs == pytest.approx(2 / 2**6)


def test_every_pair_of_a_table_counts_in_its_correction_and_other_tables_do_not():
    first = [
        one
        for name, values in (("a", "1" * 12), ("b", "0" * 12), ("c", "0" * 12))
        for one in outcomes(name, values)
    ]
    other = [dataclasses.replace(one, table=("hexapod",)) for one in first if one.method != "c"]
    found = {(one.table[0], one.first, one.second): one for one in compare([*first, *other])}
    alone = found["hexapod", "a", "b"]

    assert len(found) == 4
    assert alone.p_holm == alone.p_runs == pytest.approx(2 / 2**12)
    assert found["quadruped", "a", "b"].p_holm == pytest.approx(3 * 2 / 2**12)
    assert found["quadruped", "b", "c"].p_holm == 1
    assert found["quadruped", "a", "b"].better == "a"
    assert found["quadruped", "b", "c"].better is None


def test_a_difference_that_one_seed_makes_is_not_called_better():
    # Twelve of twelve cases, all in one seed of four: McNemar's test alone would be sure.
    one_seed = "1000" * 12
    (found,) = compare([*outcomes("a", one_seed), *outcomes("b", "0" * 48)])

    assert found.p_runs < 0.001
    assert found.difference.low < 0
    assert found.p_holm == found.p_seeds == pytest.approx(0.391, abs=0.001)
    assert found.better is None


def test_numbers_are_compared_by_their_signs_and_their_seeds():
    values = {"far": 3.0, "near": 1.0}
    rows = [
        Outcome(("m",), name, (f"case {case}",), seed, value + 0.1 * seed * case, "number")
        for name, value in values.items()
        for case in (1, 2)
        for seed in range(6)
    ]
    (found,) = compare(rows)

    assert found.difference.estimate == pytest.approx(2)
    assert found.p_runs == pytest.approx(2 / 2**12)
    assert found.p_seeds < 1e-6
    assert found.better == "far"


def test_the_order_of_the_outcomes_does_not_matter_and_a_run_counts_once():
    rows = [*outcomes("a", "1101" * 6), *outcomes("b", "0100" * 6)]

    assert compare(rows) == compare(rows[::-1])
    with pytest.raises(InputError, match="one outcome of a in quadruped, 3 trials, case 0"):
        compare([*rows, rows[0]])


def test_methods_without_a_common_run_are_not_compared():
    apart = [dataclasses.replace(one, seed=one.seed + 9) for one in outcomes("b", "1111")]

    assert compare([*outcomes("a", "1111"), *apart]) == ()


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_an_outcome_without_a_value_is_refused_and_is_no_difference(value: float):
    with pytest.raises(InputError, match="expected a finite value of a in m, case 1, seed 0"):
        Outcome(("m",), "a", ("case 1",), 0, value, "number")


def test_numbers_that_are_all_0_or_1_are_numbers():
    metres = [
        Outcome(("m",), method, (f"case {case}",), seed, float(value), "number")
        for method, value in (("a", 1), ("b", 0))
        for case in range(2)
        for seed in range(3)
    ]
    shares = [dataclasses.replace(one, measure="share") for one in metres]
    (in_metres,), (right,) = compare(metres), compare(shares)

    # All differences are 1 m: no run contradicts it. Of proportions, a rarer error may be unseen.
    assert (in_metres.difference.low, in_metres.difference.high) == (1, 1)
    assert right.difference.low < 1


def test_a_share_has_no_other_values_and_a_table_one_measure():
    with pytest.raises(InputError, match="expected 1 or 0 of a in m, case 1, seed 0"):
        Outcome(("m",), "a", ("case 1",), 0, 0.5, "share")
    rows = outcomes("a", "1101") + [
        dataclasses.replace(one, measure="number") for one in outcomes("b", "0100")
    ]
    with pytest.raises(InputError, match="expected one measure in the table quadruped, 3 trials"):
        compare(rows)
