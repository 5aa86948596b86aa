"""Promises of the tables: medians over runs, fair costs, and the paper's results beside ours."""

import pytest

from selfmodel.experiments.paper.plan import ON_ROBOT
from selfmodel.experiments.paper.tables import costs, failures, last_costs, summaries
from tests.helpers.paper_rows import evolution, recovery, trials


def test_a_row_of_table_two_has_medians_and_counts_of_its_runs():
    rows = [
        recovery(seed=0, recovered=1.0),
        recovery(seed=1, recovered=1.6, correct=False),
        recovery(seed=2, recovered=4.0),
    ]

    (found,) = summaries(rows)

    assert (found.runs, found.right, found.best) == (3, 2, "intact")
    assert (found.recovered, found.recovery) == (1.6, 0.8)
    assert (found.lowest, found.highest) == (0.5, 2.0)
    assert found.restored == 2  # 0.8 is restored, 0.5 is not


def test_a_gait_that_did_not_walk_forward_is_in_no_ratio():
    (found,) = summaries([recovery(before=-0.1), recovery(seed=1, recovered=1.0)])
    (none,) = summaries([recovery(before=0.0)])

    assert (found.recovery, found.restored, found.runs) == (0.5, 0, 2)
    assert (none.recovery, none.lowest, none.highest) == (None, None, None)


def test_every_comparator_and_case_has_its_row():
    rows = [recovery(case=case, comparator=name) for case in (1, 2) for name in ("b", "a")]

    found = [(row.case, row.comparator) for row in summaries(rows)]

    assert found == [(1, "b"), (1, "a"), (2, "b"), (2, "a")]


@pytest.mark.parametrize(("robot", "missed"), [("quadruped", (7, 8)), ("hexapod", (4, 7, 10))])
def test_a_row_has_what_the_paper_reports(robot: str, missed: tuple[int, ...]):
    rows = summaries([recovery(robot=robot, case=case) for case in range(1, 11)])

    assert tuple(row.case for row in rows if not row.restored_in_paper) == missed


def test_table_one_has_each_case_of_each_robot_once():
    rows = [
        recovery(robot=robot, comparator=name)
        for robot in ("quadruped", "hexapod")
        for name in "ab"
    ]

    found = failures(rows)

    assert [(row.case, row.robot) for row in found] == [(1, "quadruped"), (1, "hexapod")]
    assert found[0].failure == "a lower leg breaks off"


def test_only_runs_that_all_ways_have_count():
    easy, hard = {"case": 9}, {"case": 7}
    rows = [
        *trials([2.0, 0.0, 2.0], **easy),
        *trials([2.0, 0.0, 1.0], **hard),
        *trials([2.0, 0.0, 2.0], comparator="b", **hard),
    ]

    found = costs(rows, evolution([0.5, 1.0], **hard))

    assert {(cost.way, cost.physical_trials): cost.recovery for cost in found} == {
        ("a", 1): 0.5,
        ("b", 1): 1.0,
        (ON_ROBOT, 10): 0.25,
        (ON_ROBOT, 20): 0.5,
    }
    assert {cost.runs for cost in found} == {1}


def test_robots_are_paired_each_for_itself():
    rows = [*trials([2.0, 0.0, 2.0]), *trials([2.0, 0.0, 1.0], robot="hexapod", comparator="b")]

    assert [(cost.robot, cost.way) for cost in costs(rows, [])] == [
        ("quadruped", "a"),
        ("hexapod", "b"),
    ]


def test_ways_without_a_run_in_common_have_no_costs():
    assert costs(trials([2.0, 0.0, 2.0]), evolution([1.0], case=2)) == ()


def test_a_cost_has_the_quartiles_of_its_runs():
    rows = [row for seed in range(5) for row in trials([2.0, 0.0, float(seed)], seed=seed)]

    (found,) = costs(rows, [])

    assert (found.low, found.recovery, found.high, found.runs) == (0.5, 1.0, 1.5, 5)


def test_the_last_cost_is_that_of_the_most_trials():
    rows = trials([2.0, 0.0, 1.0, 2.0])

    found = last_costs(costs(rows, evolution([0.5, 1.0, 1.5])))

    assert [(cost.way, cost.physical_trials) for cost in found] == [("a", 2), (ON_ROBOT, 30)]
