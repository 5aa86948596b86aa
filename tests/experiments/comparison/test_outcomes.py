"""Tests of what the rows of a study compare."""

import dataclasses

import pytest

from selfmodel.experiments.ablation.rows import AblationRow
from selfmodel.experiments.comparison.outcomes import of_ablation, of_baselines, of_paper
from selfmodel.experiments.paper.rows import RecoveryRow
from selfmodel.experiments.statistics import compare
from tests.experiments.ablation.test_ablate import scored
from tests.experiments.baseline.test_results import row


def ablation_rows() -> list[AblationRow]:
    """Rows of two comparators on three cases and four seeds: the first is always right."""
    return [
        dataclasses.replace(
            scored(name, case, 1.0, correct=name == "a"), seed=seed, next_trial="bank"
        )
        for name in "ab"
        for case in (1, 2, 3)
        for seed in range(4)
    ]


def test_comparators_are_compared_over_all_gaps_and_at_each():
    own = scored("a", 1, 1.0, correct=True)
    other = dataclasses.replace(own, comparator="b", correct=False)
    rows = [dataclasses.replace(one, gap=gap) for one in (own, other) for gap in (0.0, 0.05)]
    found = {one.table: one for one in compare(of_ablation(rows))}

    assert [table[2:] for table in found] == [(), ("gap 0",), ("gap 0.05",)]
    assert [one.runs for one in found.values()] == [2, 1, 1]
    assert {one.first for one in found.values()} == {"a"}


def test_a_study_at_one_gap_is_compared_once():
    rows = [scored(name, 1, 1.0, correct=True) for name in "ab"]

    assert len({one.table for one in of_ablation(rows)}) == 1


def test_baselines_are_compared_in_metres_and_by_the_oracle_of_the_same_physical_robot():
    rows = [
        *(row("oracle", [2.0, 2.0], seed=0), row("oracle", [4.0, 4.0], seed=1)),
        *(row("random-search", [1.0, 2.0, 0.0], seed=seed) for seed in (0, 1, 2)),
    ]
    values = {
        (one.table[1:], one.seed): one.value
        for one in of_baselines(rows)
        if one.method == "random-search"
    }

    assert values[("after 1 trial", "÷ oracle"), 0] == 0.5
    assert values[("after 3 trials", "÷ oracle"), 1] == 0.5
    assert (("after 3 trials", "÷ oracle"), 2) not in values  # no oracle
    assert values[("after 3 trials", "m"), 2] == 2


def test_there_is_no_table_after_more_trials_than_any_method_had():
    few, many = row("random-search", [1.0, 2.0]), row("trial-and-error", [1.0] * 20)

    assert {one.table[1] for one in of_baselines([few])} == {"after 1 trial"}
    assert {one.table[1] for one in of_baselines([few, many, row("oracle", [1.0] * 50)])} == {
        *("after 1 trial", "after 3 trials", "after 20 trials")
    }


def test_the_oracle_is_a_bound_and_is_not_compared():
    assert of_baselines([row("oracle", [2.0])]) == ()


def test_the_papers_comparators_are_compared_by_diagnosis_and_by_recovery():
    one = RecoveryRow(
        robot="quadruped",
        case=1,
        truth="x",
        seed=0,
        comparator="a",
        compared_by="a",
        best="x",
        correct=True,
        before=2.0,
        after=0.0,
        recovered=1.5,
        distinct_hypotheses=1,
        diverged=0,
        seconds=1.0,
    )
    other = dataclasses.replace(one, comparator="b", correct=False, recovered=1.0)
    found = {c.table[1]: c.difference.estimate for c in compare(of_paper([one, other]))}

    assert found == {"right": 1, "recovered, m": pytest.approx(0.5)}
