"""Figure of the held-out part of the recording: measured positions and predictions."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from benchmarks.go2.sample import RATE, positions_and_commands, simulated
from benchmarks.go2.study import ALL, FITTED
from selfmodel.robot.robot import Robot


def draw(nominal: Robot, fitted: Robot, path: Path) -> None:
    """Draws four joints into a PNG file."""
    positions, commands = positions_and_commands(nominal)
    time = np.arange(FITTED, ALL) / RATE
    chosen = ("FL_hip_joint", "FL_thigh_joint", "FL_calf_joint", "RL_calf_joint")
    lines = {
        "measured": (positions, "black", 1.4),
        "nominal": (simulated(nominal, positions, commands), "tab:red", 1.0),
        "calibrated": (simulated(fitted, positions, commands), "tab:blue", 1.0),
    }
    figure, axes = plt.subplots(len(chosen), 2, figsize=(11, 9), sharex=True)
    for (left, right), name in zip(axes, chosen, strict=True):
        column = nominal.anatomy.hinges.index(name)
        left.plot(time, commands[FITTED:, column], color="0.7", lw=0.8, label="command")
        for label, (values, color, width) in lines.items():
            left.plot(time, values[FITTED:, column], color=color, lw=width, label=label)
            if label != "measured":
                error = 1e3 * (values - positions)[FITTED:, column]
                right.plot(time, error, color=color, lw=width)
        left.set_ylabel(f"{name.removesuffix('_joint')}, rad")
        right.set_ylabel("error, mrad")
        right.grid(alpha=0.3)
    axes[0, 0].legend(fontsize=7, ncol=4, loc="upper center", bbox_to_anchor=(0.5, 1.25))
    for axis in axes[-1]:
        axis.set_xlabel("time, s")
    figure.tight_layout()
    figure.savefig(path, dpi=100)
