"""Tests of the figure of paired differences."""

import dataclasses

from matplotlib.axes import Axes

from selfmodel.experiments.comparison.difference_figure import paired_differences
from selfmodel.experiments.confidence_intervals import Interval
from selfmodel.experiments.statistics import Comparison, compare
from selfmodel.experiments.study.drawing import files_of
from tests.experiments.statistics.test_comparison import outcomes


def pairs() -> list[Comparison]:
    """Comparisons of three methods, of which one is better."""
    rows = [*outcomes("a", "1" * 12), *outcomes("b", "0" * 12), *outcomes("c", "0" * 12)]
    return list(compare(rows))


def labels(axes: Axes) -> list[str]:
    return [label.get_text() for label in axes.get_yticklabels()]


def test_every_pair_has_a_line_with_its_interval_and_its_number_of_runs():
    found = pairs()
    (axes,) = paired_differences(found).axes

    assert sorted(labels(axes)) == [
        *("a − b (n = 12)", "a − c (n = 12)", "b − c (n = 12)"),  # noqa: RUF001  # minus signs
    ]
    ends = {tuple(line.get_xdata()) for line in axes.get_lines()}
    assert {(one.difference.low, one.difference.high) for one in found} <= ends


def test_a_better_method_has_a_filled_marker():
    (axes,) = paired_differences(pairs()).axes
    fills = [line.get_markerfacecolor() for line in axes.get_lines() if line.get_marker() == "o"]

    assert len(fills) == 3
    assert [fill != "white" for fill in fills] == [False, True, True]


def test_metres_have_an_axis_of_their_own():
    metres = [
        dataclasses.replace(one, table=("quadruped", "m"), difference=Interval(5.0, 3.0, 7.0))
        for one in pairs()
    ]
    first, second = paired_differences([*pairs(), *metres]).axes

    assert first.get_xlim() != second.get_xlim()


def test_a_name_with_dollar_signs_is_a_name_and_no_formula():
    odd = [dataclasses.replace(one, table=("$a_{$.xml",), first="$x^{$") for one in pairs()]

    assert files_of("odd", paired_differences(odd))["odd.png"].startswith(b"\x89PNG")
