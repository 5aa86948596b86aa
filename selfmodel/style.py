"""Style of figures: fonts and sizes from a file, panels, labels, files, and values by name."""

import io
import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from types import MappingProxyType
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.style import use as use_style

from selfmodel.errors import InputError, typed
from selfmodel.files import check_regular, path_of

STYLE = Path(__file__).with_name("figures.mplstyle")
"""Style file of matplotlib: ``matplotlib.style.use(STYLE)`` draws other figures alike."""

TEXTS = (
    "font.size",
    *(f"{part}.{size}size" for part in ("axes", "figure") for size in ("title", "label")),
)
WIDTHS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        name: {**dict.fromkeys(TEXTS, 8), "legend.fontsize": 7, "figure.figsize": (inches, 3.0)}
        for name, inches in {"column": 3.5, "page": 7.16}.items()
    }
)
"""Styles of figures as wide as a column, or as both, of the journals of the IEEE."""

PANEL = 3.0
"""Smallest width of a panel in a figure of given width with panels side by side, inches."""

FONT = 10.0
"""Size of the font in ``STYLE``, with which the sizes of figures are stated, points."""

given_width: ContextVar[float | None] = ContextVar("given_width", default=None)
"""Width of figures that the style sets, inches; None for that of each."""

_styled: ContextVar[bool] = ContextVar("styled", default=False)

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#333333")
"""Colours of methods, distinguishable with colour blindness.

Source: M. Okabe and K. Ito, *Color Universal Design* (2008).
"""

MARKERS, LINES = "osD^v<P*", ("-", "--", ":", "-.")
"""Markers and lines of methods; both change when the colours recur."""

Style = dict[str, Any]
"""Arguments of matplotlib."""

REFERENCE: Style = {"color": "0.35", "linestyle": "--", "linewidth": 1.0}


@contextmanager
def figure_style(style: str | Path | None = None) -> Iterator[None]:
    """Context manager in which figures are made and written in a style.

    Args:
        style: ``column`` or ``page``, for the width of a column or of both; or the path of a style
            file of matplotlib, whose ``figure.figsize`` sets the width. What it leaves open is as
            in ``STYLE``. None for ``STYLE``, or for the style of the context around this one.

    Raises:
        InputError: The file cannot be read as a style.
    """
    if style is None and _styled.get():
        yield
        return
    own = read_style(style)
    size = own.get("figure.figsize")
    tokens = given_width.set(None if size is None else float(size[0])), _styled.set(True)
    try:
        with mpl.rc_context(fname=STYLE):
            use_style(dict(own))
            yield
    finally:
        given_width.reset(tokens[0])
        _styled.reset(tokens[1])


def read_style(style: str | Path | None) -> Mapping[str, Any]:
    """Returns the settings of matplotlib of a style; see ``figure_style``."""
    if style is None or str(style) in WIDTHS:
        return WIDTHS.get(str(style), {})
    what = f"{', '.join(WIDTHS)}, or a style file of matplotlib, FILE.mplstyle"
    path = path_of(style, what)
    check_regular(path, what)
    try:
        own = mpl.rc_params_from_file(path, fail_on_error=True, use_default_template=False)
    except (OSError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise InputError(f"{path}: expected {what}, got {reason}") from error
    if not own:
        raise InputError(f"{path}: expected {what}, got no setting, such as `font.size: 8`")
    named = {str(name): value for name, value in own.items()}
    # The size of the font rules the sizes that the style leaves open.
    scale = named.get("font.size", FONT) / FONT
    usual = mpl.rc_params_from_file(STYLE, use_default_template=False).items()
    sizes = {str(name): scale * value for name, value in usual if str(name).endswith("size")}
    sized = (sizes if scale != 1 else {}) | named
    try:
        with mpl.rc_context():
            use_style(dict(sized))
            figure = Figure()
            figure.suptitle("a figure")
            figure.savefig(io.BytesIO(), format="png")
    except (ValueError, RuntimeError, MemoryError) as error:
        reason = " ".join(str(error).split())[:200]
        raise InputError(f"{path}: no figure can be drawn in this style: {reason}") from error
    return sized


@typed
@figure_style()
def files_of(name: str, figure: Figure) -> dict[str, bytes]:
    """Returns a figure as PNG, PDF and SVG of a name, the same bytes in every call."""
    files = {}
    for suffix, date in (("png", None), ("pdf", "CreationDate"), ("svg", "Date")):
        data = io.BytesIO()
        figure.savefig(data, format=suffix, metadata={date: None} if date else None)
        files[f"{name}.{suffix}"] = data.getvalue()
    return files


@figure_style()
def look(number: int, variant: int = 0, of: int = 1) -> Style:
    """Returns colour, marker and line of a method, one of some, as arguments of matplotlib.

    A variant of a method has its colour. No two of eight times as many as the colours look alike.
    """
    colours = mpl.rcParams["axes.prop_cycle"].by_key().get("color", COLOURS)
    turn, place = divmod(number, len(colours))
    turn += variant * math.ceil(of / len(colours))
    marker, line = MARKERS[(place + turn) % len(MARKERS)], LINES[turn % len(LINES)]
    return {"color": colours[place], "marker": marker, "linestyle": line}


def errorbars(axes: Axes, points: Any, number: int, **style: Any) -> None:  # noqa: ANN401  # of matplotlib
    """Draws estimates with the ends of their intervals, x, y, low and high, in a method's look."""
    x, y, low, high = np.array(points).reshape(-1, 4).T
    # An interval may end a rounding error inside its estimate.
    bars = np.maximum([y - low, high - y], 0)
    drawn = {"markersize": 5, "capsize": 2, "elinewidth": 0.8, **look(number), **style}
    axes.errorbar(x, y, yerr=bars, **drawn)


def panels_of(
    count: int,
    columns: int = 2,
    *,
    size: tuple[float, float],
    margin: tuple[float, float],
    share: Any,  # noqa: ANN401  # of matplotlib
) -> tuple[Figure, list[Axes]]:
    """Returns a figure with panels, of a size each, and a margin around all of them, in inches.

    The panels share the axes ``x``, ``y``, both (True) or none (False).
    """
    width, columns = given_width.get(), min(count, columns)
    if width is not None:
        columns = max(1, min(columns, int(width / PANEL)))
        scale = text_size(1) / FONT
        margin, size = (0, margin[1] * scale), (width / columns, size[1] * scale)
    rows = math.ceil(count / columns)
    whole_size = (margin[0] + columns * size[0], margin[1] + rows * size[1])
    figure = Figure(figsize=whole_size, layout="constrained")
    sharex, sharey = (share in (way, True) for way in "xy")
    panels = list(figure.subplots(rows, columns, sharex=sharex, sharey=sharey, squeeze=False).flat)
    for number, axes in enumerate(panels):
        axes.tick_params(labelbottom=True)
        axes.set_visible(number < count)
    return figure, panels[:count]


def legend_below(figure: Figure, columns: int) -> None:
    """Puts a legend of the labels of all panels below them, for which the figure grows."""
    handles = {
        folded(label): handle
        for axes in figure.axes
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    for ncols in range(columns, 0, -1):
        place: Style = {"loc": "outside lower center", "handlelength": 3, "ncols": ncols}
        legend = figure.legend(handles.values(), handles.keys(), **place)
        size = legend.get_window_extent()
        if ncols == 1 or size.width <= figure.bbox.width:
            break
        legend.remove()
    # The margins of figures have room for two lines.
    more = size.height / figure.dpi - 4 * text_size(1) / 72
    figure.set_figheight(figure.get_figheight() + max(0, more))


def text_size(share: float) -> float:
    """Returns a part of the size of the font, in points."""
    return share * float(mpl.rcParams["font.size"])


def row_label(name: str, rest: str) -> str:
    """Returns a label of a row: on two lines in a figure of a given width."""
    space = " " if given_width.get() is None else "\n"
    return f"{name}{space}{rest}"


def folded(text: str) -> str:
    """Returns a text on lines that a figure of a given width has room for."""
    width = given_width.get()
    return text if width is None else textwrap.fill(text, int(72 * width / text_size(0.55)))


@figure_style()
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
    """Returns a figure of values by name, the first above: bars from 0, or points with intervals.

    A value that is not finite is left out. ``others`` is the label of other values of the same
    names, drawn as open points, and these. A vertical line marks the reference.
    """
    places = np.arange(len(names))
    shown = np.where(np.isfinite(values), values, np.nan)
    size = (3.5 + 0.07 * max(map(len, names), default=0), 1.1 + 0.27 * len(names))
    figure, (axes,) = panels_of(1, 1, size=size, margin=(0, 0), share=False)
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
