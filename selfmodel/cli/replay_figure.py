"""A replay as a figure: where the robot went and where the simulation did, and how they part."""

import io
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from selfmodel.errors import InputError, WorkError
from selfmodel.logs.errors import LogWriteError
from selfmodel.logs.files import refuse_existing, replace_file
from selfmodel.logs.reader import TrialLog
from selfmodel.simulation.replay import Replay

if TYPE_CHECKING:
    from selfmodel.trials.behaviour import Signal

FORMATS = ("png", "svg", "pdf")

SHOWN: "tuple[tuple[Signal, str], ...]" = (
    ("base_position", "base position, m"),
    ("joint_positions", "joint angles, rad"),
    ("commands", "commands"),
    ("sensors", "sensor readings"),
)


def check_figure(path: Path) -> None:
    """Checks the name of a figure before any work is done for it.

    Raises:
        InputError: It has another ending than a figure's, or exists.
    """
    if path.suffix.lower().removeprefix(".") not in FORMATS:
        raise InputError(f"--out needs a name that ends in .png, .svg or .pdf, got {str(path)!r}")
    if not path.parent.is_dir():
        raise InputError(f"{path}: there is no folder {path.parent}: make it, or choose another")
    refuse_existing(path)


def draw(path: Path, log: TrialLog, found: Replay, hypothesis: str) -> None:
    """Draws a replay into a file.

    Raises:
        WorkError: It could not be written.
    """
    logged = log.trial.behaviour
    figure = Figure(figsize=(8, 6), layout="constrained")
    way, error = figure.subplots(2, 1, sharex=True)
    way.plot(logged.time, logged["base_position"][:, 0], label="logged")
    way.plot(
        logged.time, found.simulated["base_position"][:, 0], "--", label=f"simulated: {hypothesis}"
    )
    way.set_ylabel("base, forward, m")
    way.legend()
    for signal, title in SHOWN:
        # A logarithm has no place for 0, which is what identical looks like.
        error.plot(
            logged.time,
            np.where(found.errors[signal] > 0, found.errors[signal], np.nan),
            label=title,
        )
    error.set_yscale("log")
    error.set_ylabel("difference, root mean square")
    error.set_xlabel("time, s")
    error.legend()
    if found.first_divergence_step is not None:
        for axes in (way, error):
            axes.axvline(logged.time[found.first_divergence_step], color="0.6", linewidth=1)
    way.set_title(_title(log, found))
    data = io.BytesIO()
    figure.savefig(data, format=path.suffix.lower().removeprefix("."), dpi=150)
    try:
        replace_file(path, data.getvalue())
    except LogWriteError as error:
        raise WorkError(f"{path}: the figure could not be written: {error.reason}") from error


def _title(log: TrialLog, found: Replay) -> str:
    name = f"{log.trial.robot}, {log.trial.plan.name}".replace("$", r"\$")
    if found.first_divergence_step is None:
        return f"{name}: the same all the way"
    return f"{name}: they part at step {found.first_divergence_step}"
