"""Figures of an ablation: right diagnoses by reality gap, and by case."""

import io
import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from selfmodel.experiments.ablation.rows import AblationRow
from selfmodel.experiments.ablation.scores import ComparatorScore
from selfmodel.experiments.confidence_intervals import Interval
from selfmodel.experiments.study_files import key_of

if TYPE_CHECKING:
    from matplotlib.artist import Artist

MARKERS = "osD^v<>pP*Xhd"


def draw(
    rows: Sequence[AblationRow], scores: Sequence[ComparatorScore]
) -> Iterator[tuple[str, bytes]]:
    """Yields the name and the PNG of each figure; no figures without rows."""
    if not rows:
        return
    yield "gap.png", _png(by_gap(scores))
    shown = _first_and_last(sorted({row.trials for row in rows}))
    for robot in sorted({row.robot for row in rows}):
        for trials in shown:
            same = [row for row in rows if (row.robot, row.trials) == (robot, trials)]
            if same:
                yield f"cases-{key_of(robot)}-{trials}.png", _png(_by_case(robot, trials, same))


def _first_and_last(trials: Sequence[int]) -> list[int]:
    return sorted({trials[0], trials[-1]})


def by_gap(scores: Sequence[ComparatorScore]) -> Figure:
    """Returns right diagnoses by gap: a panel per robot and trial count, a line per comparator."""
    robots = sorted({score.robot for score in scores})
    shown = _first_and_last(sorted({score.trials for score in scores}))
    comparators = sorted({score.comparator for score in scores})
    gaps = sorted({score.gap for score in scores})
    figure = Figure(figsize=(1 + 4.2 * len(shown), 0.8 + 3.2 * len(robots)), layout="constrained")
    panels = figure.subplots(len(robots), len(shown), sharex=True, sharey=True, squeeze=False)
    spread = 0.012 * (max(gaps) - min(gaps) or 1)  # error bars side by side
    for i, robot in enumerate(robots):
        for j, trials in enumerate(shown):
            axes = panels[i, j]
            for k, comparator in enumerate(comparators):
                line = {
                    score.gap: score.correct
                    for score in scores
                    if (score.robot, score.comparator, score.trials) == (robot, comparator, trials)
                }
                if line:
                    shift = spread * (k - (len(comparators) - 1) / 2)
                    _line(axes, line, comparator, k, shift)
            axes.set_title(f"{robot}, {trials} {'trial' if trials == 1 else 'trials'}")
            axes.set_ylim(-0.03, 1.03)
            axes.set_xticks(gaps)
            axes.spines[["top", "right"]].set_visible(False)
            axes.grid(axis="y", alpha=0.3)
            axes.tick_params(labelbottom=True)
    for axes in panels[-1]:
        axes.set_xlabel("reality gap")
    figure.supylabel("right diagnoses (95 % interval)")
    handles: dict[str, Artist] = {}
    for axes in panels.flat:
        found, labels = axes.get_legend_handles_labels()
        handles.update(zip(labels, found, strict=True))
    figure.legend(
        [handles[name] for name in comparators],
        comparators,
        loc="outside lower center",
        ncols=min(3, len(comparators)),
        frameon=False,
    )
    return figure


def _line(axes: Axes, line: dict[float, Interval], label: str, number: int, shift: float) -> None:
    gaps = sorted(line)
    middle = np.array([line[gap].estimate for gap in gaps])
    ends = np.array([[line[gap].low, line[gap].high] for gap in gaps]).T
    # Wilson's interval may end a rounding error inside its estimate.
    bars = np.maximum([middle - ends[0], ends[1] - middle], 0)
    axes.errorbar(
        np.array(gaps) + shift,
        middle,
        yerr=bars,
        label=label,
        marker=MARKERS[number % len(MARKERS)],
        color=f"C{number}",  # the same in panels without all comparators
        markersize=5,
        capsize=2,
        linewidth=1.5,
        elinewidth=0.8,
    )


def _by_case(robot: str, trials: int, rows: Sequence[AblationRow]) -> Figure:
    """Returns right diagnoses by case and comparator, a panel per gap."""
    gaps = sorted({row.gap for row in rows})
    cases = sorted({row.failure for row in rows})
    comparators = sorted({row.comparator for row in rows})
    across = min(2, len(gaps))
    down = math.ceil(len(gaps) / across)
    names = 0.09 * max(map(len, comparators))
    width = 1.2 + names + across * (0.4 + 0.42 * len(cases))
    size = (width, 0.6 + down * (0.8 + 0.36 * len(comparators)))
    figure = Figure(figsize=size, layout="constrained")
    panels = figure.subplots(down, across, sharey=True, squeeze=False).flatten()
    for axes in panels[len(gaps) :]:
        axes.set_visible(False)
    for axes, gap in zip(panels[: len(gaps)], gaps, strict=True):
        shares = np.full((len(comparators), len(cases)), np.nan)
        for i, comparator in enumerate(comparators):
            for j, case in enumerate(cases):
                right = [
                    row.correct
                    for row in rows
                    if (row.gap, row.comparator, row.failure) == (gap, comparator, case)
                ]
                if right:
                    shares[i, j] = np.mean(right)
                    _write(axes, j, i, shares[i, j])
        axes.imshow(shares, vmin=0, vmax=1, cmap="viridis", aspect="auto")
        axes.set_xticks(range(len(cases)), cases)
        axes.set_yticks(range(len(comparators)), comparators)
        axes.set_title(f"gap {gap:g}", fontsize=10)
        axes.set_xlabel("case")
    figure.suptitle(
        f"{robot}, {trials} {'trial' if trials == 1 else 'trials'}: right diagnoses, %", fontsize=11
    )
    return figure


def _write(axes: Axes, column: int, row: int, share: float) -> None:
    colour = "white" if share < 0.5 else "black"
    axes.text(column, row, f"{100 * share:.0f}", ha="center", va="center", fontsize=7, color=colour)


def _png(figure: Figure) -> bytes:
    data = io.BytesIO()
    figure.savefig(data, format="png", dpi=150)
    return data.getvalue()
