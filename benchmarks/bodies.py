"""Recoveries of bodies, from the rows of studies that ``selfmodel suite run`` made.

``python -m benchmarks.bodies FOLDER...`` prints the tables of ``docs/results/bodies.md`` and draws
``docs/figures/bodies.png``.
"""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from statistics import median

import matplotlib as mpl

mpl.use("Agg")  # a figure in a file needs no display

from matplotlib import pyplot as plt

from selfmodel.experiments.suite.rows import SINGLE, SuiteRow, Summary, summarise

FIGURE = Path("docs/figures/bodies.png")


def main() -> None:
    """Prints the tables and draws the figure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", type=Path, nargs="+", help="a folder of such a study")
    folders = parser.parse_args().folders
    rows = [row for folder in folders for row in _single_faults(folder)]
    rows.sort(key=lambda row: row.robot)
    found = {(one.robot, one.case): one for one in summarise(rows)}
    bodies = list(dict.fromkeys(row.robot for row in rows))
    print("| body | before | after | recovered | recovered ÷ before | right |")
    print("|---|---:|---:|---:|---:|---:|")
    for body in bodies:
        one = found[body, None]
        scores = f"{one.before:.2f} | {one.after:.2f} | {one.recovered:.2f} | {_recovery(one)}"
        print(f"| `{body}` | {scores} | {one.right} of {one.runs} |")
    right, parts = sum(row.correct for row in rows), [row.recovered / row.before for row in rows]
    print(f"| all | | | | {median(parts):.2f} | {right} of {len(rows)} |\n")
    print(f"| body | {' | '.join(f'case {case}' for case in SINGLE)} |")
    print(f"|---|{'---:|' * len(SINGLE)}")
    for body in bodies:
        print(f"| `{body}` | {' | '.join(_recovery(found.get((body, case))) for case in SINGLE)} |")
    _draw(rows, bodies)


def _single_faults(folder: Path) -> list[SuiteRow]:
    found = json.loads((folder / "results.json").read_text(encoding="utf-8"))
    rows = [SuiteRow(**row) for row in found["rows"]]
    return [row for row in rows if row.case in SINGLE]


def _recovery(summary: Summary | None) -> str:
    if summary is None or summary.recovery is None:
        return ""
    return f"{summary.recovery:.2f}"


def _draw(rows: Sequence[SuiteRow], bodies: Sequence[str]) -> None:
    figure, axes = plt.subplots(figsize=(8, 0.4 * len(bodies) + 1.2), layout="constrained")
    for y, body in enumerate(reversed(bodies)):
        own = [row for row in rows if row.robot == body]
        for shift, name, colour in ((0.15, "after", "tab:red"), (-0.15, "recovered", "tab:blue")):
            parts = [getattr(row, name) / row.before for row in own]
            heights = [y + shift] * len(parts)
            axes.plot(parts, heights, ".", color=colour, alpha=0.4, markersize=5)
            label = f"{name} (median)" if y == 0 else None
            axes.plot(median(parts), y + shift, "|", color=colour, markersize=12, label=label)
    axes.axvline(1, color="grey", linewidth=0.8)
    axes.axvline(0.8, color="grey", linewidth=0.8, linestyle=":")
    axes.set_yticks(range(len(bodies)), reversed(bodies))
    axes.set_xlabel("score as a part of that before the failure; one fault each")
    axes.set_xlim(-0.6, 3)
    figure.legend(frameon=False, loc="outside upper center", ncols=2)
    axes.spines[["top", "right"]].set_visible(False)
    FIGURE.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(FIGURE, dpi=150)


if __name__ == "__main__":
    main()
