"""Figure of a replay: logged and simulated path of the base, and the error of the signals."""

import io
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from selfmodel.cli.inputs import check_folder
from selfmodel.cli.output.plain import figure_text
from selfmodel.errors import InputError
from selfmodel.logs.files import refuse_existing, replace_file
from selfmodel.logs.reader import TrialLog
from selfmodel.simulation.trial_replay import Replay
from selfmodel.trials.signals import Signal

FORMATS = ("png", "svg", "pdf")

SHOWN: tuple[tuple[Signal, str], ...] = (
    ("base_position", "base position, m"),
    ("joint_positions", "joint angles, rad"),
    ("commands", "commands"),
    ("sensors", "sensor readings"),
)


def check_figure(path: Path) -> None:
    """Checks the name of a figure.

    Raises:
        InputError: The name has no extension of a figure, the folder is missing, or the file
            exists.
    """
    if path.suffix.lower().removeprefix(".") not in FORMATS:
        raise InputError(f"--out needs a name that ends in .png, .svg or .pdf, got {str(path)!r}")
    check_folder(path)
    refuse_existing(path)


def draw(path: Path, log: TrialLog, found: Replay, hypothesis: str) -> None:
    """Draws a replay into a file.

    Args:
        path: File to write.
        log: The logged trial.
        found: Its replay.
        hypothesis: Notation of the simulated hypothesis.

    Raises:
        LogWriteError: The disk is full, or failed.
    """
    logged = log.trial.behaviour
    figure = Figure(figsize=(8, 6), layout="constrained")
    path_axes, error = figure.subplots(2, 1, sharex=True)
    path_axes.plot(logged.time, logged["base_position"][:, 0], label="logged")
    path_axes.plot(
        logged.time,
        found.simulated["base_position"][:, 0],
        "--",
        label=figure_text(f"simulated: {hypothesis}"),
    )
    path_axes.set_ylabel("base, forward, m")
    path_axes.legend()
    for signal, title in SHOWN:
        # Identical steps have an error of 0, which a logarithmic axis cannot show.
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
        for axes in (path_axes, error):
            axes.axvline(logged.time[found.first_divergence_step], color="0.6", linewidth=1)
    path_axes.set_title(_title(log, found))
    data = io.BytesIO()
    figure.savefig(data, format=path.suffix.lower().removeprefix("."), dpi=150)
    replace_file(path, data.getvalue())


def _title(log: TrialLog, found: Replay) -> str:
    name = figure_text(f"{log.trial.robot}, {log.trial.plan.name}")
    if found.first_divergence_step is None:
        return f"{name}: equal at every step"
    return f"{name}: they differ from step {found.first_divergence_step}"
