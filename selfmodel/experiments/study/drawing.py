"""Style of the figures of studies, and their files: PNG, PDF and SVG, by one style file."""

import io
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

STYLE = Path(__file__).with_name("figures.mplstyle")
"""Style file of matplotlib: ``matplotlib.style.use(STYLE)`` draws other figures alike."""

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#333333")
"""Colours of methods, distinguishable with colour blindness.

Source: M. Okabe and K. Ito, *Color Universal Design* (2008).
"""

MARKERS = "osD^v<P*"
"""Markers of methods, one more than colours, so that no pair recurs soon."""


@contextmanager
def figure_style() -> Iterator[None]:
    """Context manager in which figures are made and written with the style of ``STYLE``."""
    with mpl.rc_context(fname=STYLE):
        yield


def look(number: int) -> dict[str, Any]:
    """Returns colour and marker of a method by its number, as arguments of matplotlib."""
    return {
        "color": COLOURS[number % len(COLOURS)],
        "marker": MARKERS[number % len(MARKERS)],
    }


def plain_axes(axes: Axes) -> None:
    """Removes the upper and the right spine, and adds horizontal lines."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis="y", alpha=0.3)
    axes.set_axisbelow(True)


def counts_text(counts: Iterable[int]) -> str:
    """Returns the smallest and the largest of some numbers of runs: n = 4, or n = 4 to 12."""
    ordered = sorted(counts)
    if not ordered:
        return "n = 0"
    low, high = ordered[0], ordered[-1]
    return f"n = {low}" if low == high else f"n = {low} to {high}"


def files_of(name: str, figure: Figure) -> dict[str, bytes]:
    """Returns a figure as PNG, PDF and SVG, the same bytes in every call.

    Args:
        name: Name of the files without an extension.
        figure: The figure.
    """
    with figure_style():
        return {
            f"{name}.png": _bytes(figure, format="png"),
            f"{name}.pdf": _bytes(figure, format="pdf", metadata={"CreationDate": None}),
            f"{name}.svg": _bytes(figure, format="svg", metadata={"Date": None}),
        }


def _bytes(figure: Figure, **arguments: Any) -> bytes:  # noqa: ANN401  # as matplotlib declares it
    data = io.BytesIO()
    figure.savefig(data, **arguments)
    return data.getvalue()
