"""Figures of an ablation: right diagnoses by reality gap, and by case, with numbers of runs."""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from selfmodel.experiments.ablation.rows import AblationRow
from selfmodel.experiments.ablation.scores import ComparatorScore
from selfmodel.experiments.study.drawing import counts_text, figure_style, files_of, look
from selfmodel.experiments.study.files import key_of

if TYPE_CHECKING:
    from matplotlib.artist import Artist


def draw(
    rows: Sequence[AblationRow], scores: Sequence[ComparatorScore]
) -> Iterator[tuple[str, bytes]]:
    """Yields the name and the bytes of the PNG, PDF and SVG of each figure; none without rows."""
    if not rows:
        return
    yield from files_of("gap", by_gap(scores)).items()
    shown = _first_and_last(sorted({row.trials for row in rows}))
    for robot in sorted({row.robot for row in rows}):
        for trials in shown:
            same = [row for row in rows if (row.robot, row.trials) == (robot, trials)]
            if same:
                name = f"cases-{key_of(robot)}-{trials}"
                yield from files_of(name, by_case(robot, trials, same)).items()


def _first_and_last(trials: Sequence[int]) -> list[int]:
    return sorted({trials[0], trials[-1]})


@figure_style()
def by_gap(scores: Sequence[ComparatorScore]) -> Figure:
    """Returns right diagnoses by gap: a panel per robot and trial count, a line per comparator.

    The legend has the number n of diagnoses per point of each line.
    """
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
                    score.gap: score
                    for score in scores
                    if (score.robot, score.comparator, score.trials) == (robot, comparator, trials)
                }
                if line:
                    shift = spread * (k - (len(comparators) - 1) / 2)
                    _line(axes, line, comparator, k, shift)
            axes.set_title(f"{robot}, {trials} {'trial' if trials == 1 else 'trials'}")
            axes.set_ylim(-0.03, 1.03)
            axes.set_xticks(gaps)
            axes.grid(axis="y")
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
        [
            f"{name} ({counts_text(one.runs for one in scores if one.comparator == name)})"
            for name in comparators
        ],
        loc="outside lower center",
        ncols=min(2, len(comparators)),
    )
    return figure


def _line(
    axes: Axes, line: dict[float, ComparatorScore], label: str, number: int, shift: float
) -> None:
    gaps = sorted(line)
    middle = np.array([line[gap].correct.estimate for gap in gaps])
    ends = np.array([[line[gap].correct.low, line[gap].correct.high] for gap in gaps]).T
    # Wilson's interval may end a rounding error inside its estimate.
    bars = np.maximum([middle - ends[0], ends[1] - middle], 0)
    axes.errorbar(
        np.array(gaps) + shift,
        middle,
        yerr=bars,
        label=label,
        **look(number),  # the same in panels without all comparators
        markersize=5,
        capsize=2,
        elinewidth=0.8,
    )


@figure_style()
def by_case(robot: str, trials: int, rows: Sequence[AblationRow]) -> Figure:
    """Returns right diagnoses by case and comparator, a panel per gap.

    The name of a comparator has the number n of diagnoses per square of its row.
    """
    gaps = sorted({row.gap for row in rows})
    cases = sorted({row.failure for row in rows})
    comparators = sorted({row.comparator for row in rows})
    labels = [f"{name} ({_per_square(rows, name)})" for name in comparators]
    across = min(2, len(gaps))
    down = math.ceil(len(gaps) / across)
    names = 0.09 * max(map(len, labels))
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
        axes.set_yticks(range(len(comparators)), labels)
        axes.spines[:].set_visible(False)
        axes.set_title(f"gap {gap:g}", fontsize=10)
        axes.set_xlabel("case")
    figure.suptitle(f"{robot}, {trials} {'trial' if trials == 1 else 'trials'}: right diagnoses, %")
    return figure


def _per_square(rows: Sequence[AblationRow], comparator: str) -> str:
    """Returns the smallest and the largest number of diagnoses in a comparator's squares."""
    counts = Counter((row.gap, row.failure) for row in rows if row.comparator == comparator)
    return counts_text(counts.values())


def _write(axes: Axes, column: int, row: int, share: float) -> None:
    colour = "white" if share < 0.5 else "black"
    axes.text(column, row, f"{100 * share:.0f}", ha="center", va="center", fontsize=7, color=colour)
