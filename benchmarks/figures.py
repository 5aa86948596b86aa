"""Draws docs/figures/growth.png from benchmarks/results.json."""

import argparse
import json
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")  # a figure in a file needs no display

from matplotlib import pyplot as plt

from benchmarks.bench import RESULTS

FIGURE = Path("docs/figures/growth.png")


def main() -> None:
    """Writes the figure: cost by population, by steps and by joints."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    rows = json.loads(RESULTS.read_text(encoding="utf-8"))["growth"]
    quadruped = [row for row in rows if row["robot"] == "quadruped"]
    populations = sorted((r for r in quadruped if r["steps"] == 500), key=lambda r: r["runs"])
    lengths = sorted((r for r in quadruped if r["runs"] == 100), key=lambda r: r["steps"])
    joints = [row for row in rows if (row["runs"], row["steps"]) == (100, 500)]
    figure, panels = plt.subplots(1, 3, figsize=(10, 3), layout="constrained")
    for axes, chosen, x, label in (
        (panels[0], populations, "runs", "robots in a batch (500 steps)"),
        (panels[1], lengths, "steps", "control steps (100 robots)"),
        (panels[2], joints, "hinges", "hinges (100 robots, 500 steps)"),
    ):
        axes.plot([r[x] for r in chosen], [r["seconds"] for r in chosen], "o-")
        axes.set_xlabel(label)
        axes.set_xlim(left=0)
        axes.set_ylim(bottom=0)
        axes.spines[["top", "right"]].set_visible(False)
    panels[0].set_ylabel("seconds")
    FIGURE.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(FIGURE, dpi=150)


if __name__ == "__main__":
    main()
