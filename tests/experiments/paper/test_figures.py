"""Promises of Figures 5 and 6: drawn for what there is, with what the paper reports."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from selfmodel.experiments.paper.figures import by_cost, by_trial
from selfmodel.experiments.paper.tables import costs
from tests.helpers.paper_rows import evolution, trials

BOTH = ("quadruped", "hexapod")


def lines(figure: Figure, panel: int) -> list[np.ndarray]:
    """The heights of the drawn lines of a panel."""
    return [np.asarray(line.get_ydata()) for line in figure.axes[panel].get_lines()]


def test_a_case_has_a_line_of_medians_from_the_failing_trial_on():
    rows = [
        row
        for seed, last in enumerate((1.0, 2.0, 6.0))
        for row in trials([2.0, 0.5, 1.0, last], seed=seed)
    ]

    drawn = lines(by_trial(rows), 0)

    assert any(np.array_equal(line, [0.25, 0.5, 1.0]) for line in drawn)


@pytest.mark.parametrize(("robot", "count"), [("quadruped", 1), ("hexapod", 2)])
def test_cases_that_the_paper_did_not_restore_are_grey(robot: str, count: int):
    rows = [row for case in (4, 7, 9) for row in trials([2.0, 0.5, 1.0], robot=robot, case=case)]

    assert len(by_trial(rows).axes[0].patches) == count


def test_a_comparator_has_its_colour_in_every_panel():
    rows = [
        *trials([2.0, 0.5, 1.0], comparator="a"),
        *trials([2.0, 0.5, 1.5], comparator="b"),
        *trials([2.0, 0.5, 1.5], robot="hexapod", comparator="b"),
    ]

    colours = [
        {line.get_color() for line in axes.get_lines() if list(line.get_ydata()) == [0.25, 0.75]}
        for axes in by_trial(rows).axes
    ]

    assert colours[0] == colours[1]
    assert len(colours[0]) == 1


def test_a_robot_that_did_not_walk_forward_is_left_out():
    rows = [*trials([0.0, 0.5, 1.0]), *trials([2.0, 0.5, 1.0], case=2)]

    drawn = [line for line in lines(by_trial(rows), 0) if len(line)]

    assert all(np.isfinite(line).all() for line in drawn)


def test_the_papers_control_is_marked_for_every_robot():
    rows = [row for robot in BOTH for row in trials([2.0, 0.0, 2.0], robot=robot)]

    for axes in by_cost(costs(rows, [])).axes:
        stars = [line for line in axes.get_lines() if line.get_marker() == "*"]
        assert [list(star.get_xydata()[0]) for star in stars] == [[3000, 0.7]]


def test_the_evolution_on_the_robot_is_a_line_over_its_evaluations():
    found = costs(trials([2.0, 0.0, 2.0]), evolution([0.5, 1.0, 1.5]))

    drawn = [np.asarray(line.get_xydata()) for line in by_cost(found).axes[0].get_lines()]

    wanted = [[10, 0.25], [20, 0.5], [30, 0.75]]
    assert any(np.array_equal(line, wanted) for line in drawn)


def test_the_titles_have_the_numbers_of_recoveries():
    rows = [row for seed in range(3) for row in trials([2.0, 0.0, 2.0], seed=seed)]

    assert by_trial(rows).axes[0].get_title() == "quadruped (n = 3 per line)"
    assert by_cost(costs(rows, [])).axes[0].get_title() == "quadruped (n = 3)"
