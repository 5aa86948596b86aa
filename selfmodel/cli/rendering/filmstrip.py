"""Stick figures by matplotlib: a strip of some moments, or the frames of a film."""

import io
import textwrap
from collections.abc import Iterator

import mujoco
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from selfmodel.arrays import FloatArray
from selfmodel.cli.rendering.captions import told
from selfmodel.cli.rendering.film import Film, Shot
from selfmodel.cli.rendering.sticks import draw, draw_ground, lines_of
from selfmodel.cli.rendering.view import gaze, size

WIDTH, HEIGHT = 480, 360
"""Pixels of each motion's picture in a film."""


def strip(film: Film, kind: str) -> bytes:
    """Returns a row of pictures for each motion, a column for each moment.

    Args:
        film: What is drawn; each of its frames.
        kind: The file's, such as ``png``.
    """
    rows, columns = len(film.shots), len(film.time)
    figure = Figure(figsize=(1.9 * columns, 1.85 * rows), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False)
    data, reach = mujoco.MjData(film.model), size(film)
    for row, shot in zip(grid, film.shots, strict=True):
        centres = gaze(film, shot)
        for frame, axes in enumerate(row):
            _picture(axes, film, data, shot, frame, centres[frame], reach)
        row[0].set_title(_plain(shot.title), loc="left", fontsize=9, fontweight="bold")
    file = io.BytesIO()
    figure.savefig(file, format=kind, dpi=110)
    return file.getvalue()


def stick_frames(film: Film) -> Iterator[NDArray[np.uint8]]:
    """Draws each frame, ``(height, width, 3)``."""
    figure = Figure(figsize=(len(film.shots) * WIDTH / 100, HEIGHT / 100), dpi=100)
    canvas = FigureCanvasAgg(figure)
    data, reach = mujoco.MjData(film.model), size(film)
    ways = [gaze(film, shot) for shot in film.shots]
    for frame in range(len(film.time)):
        figure.clear()
        row = figure.subplots(1, len(film.shots), squeeze=False)[0]
        figure.subplots_adjust(left=0.01, right=0.99, bottom=0.1, top=0.88, wspace=0.03)
        for axes, shot, way in zip(row, film.shots, ways, strict=True):
            _picture(axes, film, data, shot, frame, way[frame], reach)
            axes.set_title(_plain("\n".join(textwrap.wrap(shot.title, 54))), fontsize=10)
        canvas.draw()
        yield np.asarray(canvas.buffer_rgba())[..., :3].copy()


def _picture(
    axes: Axes,
    film: Film,
    data: mujoco.MjData,
    shot: Shot,
    frame: int,
    centre: FloatArray,
    reach: float,
) -> None:
    data.qpos = shot.qpos[frame]
    mujoco.mj_kinematics(film.model, data)
    draw_ground(axes, centre, reach)
    draw(axes, film, lines_of(film, data, centre), held=bool(shot.held[frame]))
    axes.set_xlim(-1.25 * reach, 1.25 * reach)
    axes.set_ylim(-0.95 * reach, 0.95 * reach)
    axes.set_aspect("equal")
    axes.set_xticks([])
    axes.set_yticks([])
    observed = told(film, shot, frame)
    axes.set_xlabel(
        f"{observed}, not observed" if shot.held[frame] else observed,
        fontsize=8,
        color="#b01818" if shot.held[frame] else "black",
    )


def _plain(text: str) -> str:
    """A text that matplotlib does not take for a formula."""
    return text.replace("$", r"\$")
