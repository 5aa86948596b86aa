"""One figure of values by name, in the style of the figures of studies, which results share."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

STYLE = Path(__file__).parent / "studies" / "figures.mplstyle"


def values_by_name(
    title: str,
    x_label: str,
    names: Sequence[str],
    values: Sequence[float],
    *,
    ends: Sequence[tuple[float, float]] | None = None,
    others: tuple[str, Sequence[float]] | None = None,
    reference: float | None = None,
) -> Figure:
    """Returns a figure of values, the first above: bars from 0, or points with intervals.

    Args:
        title: Title of the figure.
        x_label: Quantity and unit of the values.
        names: Name of each value.
        values: The values; one that is not finite is left out.
        ends: Ends of the interval of each value, which is then a point.
        others: Label of other values of the same names, drawn as open points, and these.
        reference: Value that a vertical line marks.
    """
    places = np.arange(len(names))
    shown = np.where(np.isfinite(values), values, np.nan)
    with mpl.rc_context(fname=STYLE):
        size = (3.5 + 0.07 * max(map(len, names), default=0), 1.1 + 0.27 * len(names))
        figure = Figure(figsize=size, layout="constrained")
        axes = figure.subplots()
        if ends is None:
            axes.barh(places, np.nan_to_num(shown), height=0.6)
        else:
            bars = np.abs(np.transpose(ends) - shown)
            axes.errorbar(shown, places, xerr=bars, fmt="o", capsize=2)
        if others is not None:
            axes.plot(others[1], places, "o", mfc="white", color="0.2", label=others[0])
            figure.legend(loc="outside lower center")
        if reference is not None:
            axes.axvline(reference, color="0.35", linestyle="--", linewidth=1.0)
        axes.set_yticks(places, names)
        axes.set(title=title, xlabel=x_label)
        axes.invert_yaxis()
        axes.grid(axis="x")
    return figure
