"""Figure of paired differences between methods, with their intervals and numbers of runs."""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from selfmodel.experiments.statistics import Comparison
from selfmodel.experiments.study.drawing import COLOURS, figure_style

BETTER, UNDECIDED = COLOURS[0], "0.55"


@figure_style()
def paired_differences(comparisons: Sequence[Comparison]) -> Figure:
    """Returns the mean paired difference of every pair of methods, a panel per table.

    A filled marker is a difference that the corrected tests call better; the intervals are not
    corrected. The labels have the number n of runs that both methods have.

    Args:
        comparisons: Comparisons of one or several tables; at least one.
    """
    tables = list(dict.fromkeys(one.table for one in comparisons))
    own = {
        table: sorted(
            (one for one in comparisons if one.table == table),
            key=lambda one: one.difference.estimate,
        )
        for table in tables
    }
    longest = max(len(_label(one)) for one in comparisons)
    rows = max(map(len, own.values()))
    across = min(2, len(tables))
    down = -(-len(tables) // across)
    size = (across * (3.2 + 0.068 * longest), 0.5 + down * (0.7 + 0.21 * rows))
    figure = Figure(figsize=size, layout="constrained")
    # Proportions have one scale; metres and ratios do not.
    is_shared = all(max(-one.difference.low, one.difference.high) <= 1 for one in comparisons)
    panels = figure.subplots(down, across, sharex=is_shared, squeeze=False).flatten()
    for axes in panels[len(tables) :]:
        axes.set_visible(False)
    for axes, table in zip(panels, tables, strict=False):
        _panel(axes, own[table])
        axes.set_title(", ".join(table))
    figure.supxlabel(
        "mean paired difference, first minus second, with 95 % interval; filled: better"
    )
    return figure


def _panel(axes: Axes, comparisons: Sequence[Comparison]) -> None:
    axes.axvline(0, color="0.3", linewidth=0.8)
    for place, one in enumerate(comparisons):
        colour = BETTER if one.better else UNDECIDED
        difference = one.difference
        axes.plot([difference.low, difference.high], [place, place], color=colour, linewidth=1.2)
        axes.plot(
            [difference.estimate],
            [place],
            marker="o",
            markersize=4.5,
            color=colour,
            markerfacecolor=colour if one.better else "white",
        )
    axes.set_yticks(range(len(comparisons)), [_label(one) for one in comparisons], fontsize=8)
    axes.set_ylim(-0.7, len(comparisons) - 0.3)
    axes.grid(axis="x")
    axes.tick_params(labelbottom=True)


def _label(one: Comparison) -> str:
    return f"{one.first} − {one.second} (n = {one.runs})"  # noqa: RUF001  # a minus sign
