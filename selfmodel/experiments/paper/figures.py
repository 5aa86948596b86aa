"""Figures 5 and 6 of the paper's experiment: recovery by trial, and by number of trials."""

from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from selfmodel.experiments.paper.plan import ON_ROBOT
from selfmodel.experiments.paper.reported import (
    EVALUATIONS_ON_ROBOT,
    NOT_RESTORED,
    RESTORED_ON_ROBOT,
)
from selfmodel.experiments.paper.rows import TrialRow, best_so_far
from selfmodel.experiments.paper.tables import Cost, recoveries
from selfmodel.experiments.study.drawing import counts_text, figure_style, look, plain_axes

SLOT = 0.8
"""Width of all lines of one case; the distance between two cases is 1."""

REFERENCE = {"color": "0.35", "linestyle": "--", "linewidth": 1.0}


@figure_style()
def by_trial(trials: Sequence[TrialRow]) -> Figure:
    """Returns Figure 5: the function restored by each trial, by case, a panel per robot.

    The line of a case and a comparator has the failing trial, then the best recovery trial so far
    after one, two and more trials: medians over the seeds.

    Args:
        trials: Physical trials of all recoveries.
    """
    robots = _distinct(trial.robot for trial in trials)
    comparators = _distinct(trial.comparator for trial in trials)
    cases = sorted({trial.case for trial in trials})
    size = (1.8 + 0.75 * max(len(cases), 4), 0.9 + 2.6 * len(robots))
    figure = Figure(figsize=size, layout="constrained")
    panels = figure.subplots(len(robots), 1, sharex=True, squeeze=False)[:, 0]
    for axes, robot in zip(panels, robots, strict=True):
        own = recoveries([trial for trial in trials if trial.robot == robot])
        for place, case in enumerate(cases):
            if case in NOT_RESTORED[robot]:
                axes.axvspan(place - 0.5, place + 0.5, color="0.9", zorder=0)
        for number, comparator in enumerate(comparators):
            for place, case in enumerate(cases):
                same = [r for r in own if (r[0].case, r[0].comparator) == (case, comparator)]
                left = place - SLOT / 2 + SLOT * number / len(comparators)
                _case_line(axes, same, left, SLOT / len(comparators), number)
        axes.axhline(1, **REFERENCE)
        axes.set_xlim(-0.5, len(cases) - 0.5)
        axes.set_xticks(range(len(cases)), [str(case) for case in cases])
        axes.tick_params(labelbottom=True)
        per_line = Counter((one[0].case, one[0].comparator) for one in own)
        axes.set_title(f"{robot} ({counts_text(per_line.values())} per line)")
        plain_axes(axes)
    is_grey = any(case in NOT_RESTORED[robot] for robot in robots for case in cases)
    legend = "; grey: not restored in the paper" if is_grey else ""
    panels[-1].set_xlabel(f"case of Table I{legend}")
    figure.supylabel("displacement ÷ before the failure", fontsize=10)
    _comparator_legend(figure, comparators)
    return figure


def _case_line(
    axes: Axes, same: Sequence[Sequence[TrialRow]], left: float, width: float, number: int
) -> None:
    """Draws the medians of a case's recoveries, from the failing trial to the last."""
    values = [best_so_far(recovery) for recovery in same]
    values = [value for value in values if not np.isnan(value).any()]
    if not values:
        return
    middle = np.median(values, axis=0)
    x = left + width * (np.arange(len(middle)) + 0.75) / (len(middle) + 0.5)
    axes.plot(x, middle, **look(number), markersize=3.5, linewidth=1.2)
    # The failing trial is an open marker.
    axes.plot(x[:1], middle[:1], **look(number), markersize=3.5, markerfacecolor="white")


@figure_style()
def by_cost(costs: Sequence[Cost]) -> Figure:
    """Returns Figure 6: the function restored by the number of physical trials, per robot.

    Args:
        costs: Costs of all ways.
    """
    robots = _distinct(cost.robot for cost in costs)
    comparators = [way for way in _distinct(cost.way for cost in costs) if way != ON_ROBOT]
    figure = Figure(figsize=(0.8 + 4.4 * len(robots), 4.0), layout="constrained")
    panels = figure.subplots(1, len(robots), sharey=True, squeeze=False)[0]
    for axes, robot in zip(panels, robots, strict=True):
        for number, way in enumerate(comparators):
            own = [cost for cost in costs if (cost.robot, cost.way) == (robot, way)]
            shift = 1 + 0.06 * (number - (len(comparators) - 1) / 2)
            _points(axes, own, number, way, shift)
        _band(axes, [cost for cost in costs if (cost.robot, cost.way) == (robot, ON_ROBOT)])
        axes.plot(
            [EVALUATIONS_ON_ROBOT],
            [RESTORED_ON_ROBOT],
            linestyle="none",
            marker="*",
            markersize=11,
            markerfacecolor="white",
            color="black",
            label="the paper: over 3,000 on the robot, about 70 %",
        )
        axes.axhline(1, **REFERENCE)
        axes.set_xscale("log")
        axes.set_xlim(0.8, 2 * EVALUATIONS_ON_ROBOT)
        axes.set_xticks([1, 3, 10, 100, 1000], ["1", "3", "10", "100", "1,000"])
        axes.minorticks_off()
        axes.set_xlabel("physical trials after the failing one")
        runs = counts_text(cost.runs for cost in costs if cost.robot == robot)
        axes.set_title(f"{robot} ({runs})")
        plain_axes(axes)
    panels[0].set_ylabel("displacement ÷ before the failure")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(
        handles,
        labels,
        loc="outside lower center",
        ncols=len(robots),  # as many as fit
        frameon=False,
        fontsize=9,
    )
    return figure


def _points(axes: Axes, costs: Sequence[Cost], number: int, label: str, shift: float) -> None:
    """Draws medians with bars from the first to the third quartile."""
    middle = np.array([cost.recovery for cost in costs])
    ends = np.array([[cost.low, cost.high] for cost in costs]).reshape(-1, 2).T
    axes.errorbar(
        [shift * cost.physical_trials for cost in costs],
        middle,
        yerr=np.maximum([middle - ends[0], ends[1] - middle], 0),
        **look(number),
        label=label,
        markersize=5,
        capsize=2,
        linewidth=1.2,
        elinewidth=0.8,
    )


def _band(axes: Axes, costs: Sequence[Cost]) -> None:
    """Draws the evolution on the robot: medians as a line, quartiles as a band."""
    if not costs:
        return
    ordered = sorted(costs, key=lambda cost: cost.physical_trials)
    x = [cost.physical_trials for cost in ordered]
    axes.plot(x, [cost.recovery for cost in ordered], color="black", label="evolution on the robot")
    low, high = [cost.low for cost in ordered], [cost.high for cost in ordered]
    axes.fill_between(x, low, high, color="black", alpha=0.12, linewidth=0)


def _comparator_legend(figure: Figure, comparators: Sequence[str]) -> None:
    figure.legend(
        [figure.axes[0].plot([], [], **look(number))[0] for number in range(len(comparators))],
        comparators,
        loc="outside lower center",
        ncols=max(1, min(3, len(comparators))),
        frameon=False,
    )


def _distinct(values: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(values))
