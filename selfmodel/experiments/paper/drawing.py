"""Style of the figures of the paper's experiment, and their files."""

import io
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00")
"""Colours of comparators, distinguishable with colour blindness.

Source: M. Okabe and K. Ito, *Color Universal Design* (2008).
"""

MARKERS = "osD^vP*"
"""Markers of comparators, one more than colours, so that no pair recurs soon."""

RESOLUTION = 150
"""Pixels per inch of a PNG."""


def look(number: int) -> dict[str, Any]:
    """Returns colour and marker of a comparator by its number, as arguments of matplotlib."""
    return {
        "color": COLOURS[number % len(COLOURS)],
        "marker": MARKERS[number % len(MARKERS)],
    }


def plain_axes(axes: Axes) -> None:
    """Removes the upper and the right spine, and adds horizontal lines."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis="y", alpha=0.3)
    axes.set_axisbelow(True)


def files_of(name: str, figure: Figure) -> dict[str, bytes]:
    """Returns a figure as PNG and PDF, the same bytes in every call.

    Args:
        name: Name of the files without an extension.
        figure: The figure.
    """
    return {
        f"{name}.png": _bytes(figure, format="png", dpi=RESOLUTION),
        f"{name}.pdf": _bytes(figure, format="pdf", metadata={"CreationDate": None}),
    }


def _bytes(figure: Figure, **arguments: Any) -> bytes:  # noqa: ANN401  # as matplotlib declares it
    data = io.BytesIO()
    figure.savefig(data, **arguments)
    return data.getvalue()
