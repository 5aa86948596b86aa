"""Plots forward displacement over time in each trial of a recovery, from its logs.

Usage: python examples/plot_recovery.py RUN_FOLDER FIGURE.png
"""

import sys
from pathlib import Path

import matplotlib as mpl

from selfmodel.logs import TrialLog, read_log

mpl.use("Agg")  # a figure in a file needs no display

from matplotlib import pyplot as plt
from matplotlib.axes import Axes

COLOURS = {"before": "tab:green", "after": "tab:red", "recovery": "tab:blue"}


def main(folder: Path, figure: Path) -> None:
    """Writes the figure."""
    logs = [read_log(path) for path in sorted((folder / "trials").glob("*.mcap"))]
    _, axes = plt.subplots(figsize=(7, 3.6), layout="constrained")
    for number, log in enumerate(logs):
        draw(axes, log, shade=0.4 + 0.6 * (number + 1) / len(logs))
    axes.set_xlabel("time, s")
    axes.set_ylabel("way forward, m")
    axes.set_title(f"{logs[0].trial.robot}: physical trials before and after a failure")
    axes.legend(frameon=False)
    axes.spines[["top", "right"]].set_visible(False)
    plt.savefig(figure, dpi=150)


def draw(axes: Axes, log: TrialLog, shade: float) -> None:
    """Draws one trial."""
    trajectory, plan = log.trial.trajectory, log.trial.plan
    x = trajectory["base_position"][:, 0]
    label = f"{plan.name}: {log.trial.displacement:.2f} m"
    axes.plot(trajectory.time, x - x[0], color=COLOURS[plan.stage], alpha=shade, label=label)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(Path(sys.argv[1]), Path(sys.argv[2]))
