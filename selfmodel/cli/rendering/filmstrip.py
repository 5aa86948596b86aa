"""Stick figures by matplotlib: a strip of pictures, or the frames of a film."""

import io
import textwrap
from collections.abc import Iterator

import mujoco
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from selfmodel.cli.output.plain import figure_text
from selfmodel.cli.rendering.captions import caption
from selfmodel.cli.rendering.film import Film, Shot
from selfmodel.cli.rendering.sticks import draw, draw_ground, lines_of, plane_of
from selfmodel.cli.rendering.view import gaze, size

WIDTH, HEIGHT = 480, 360
"""Size of a motion's picture in a film, pixels."""


def strip(film: Film, kind: str) -> bytes:
    """Returns a figure file with a row per motion and a column per frame.

    Args:
        film: The film; every frame is drawn.
        kind: File format, such as ``png``.
    """
    rows, columns = len(film.shots), len(film.time)
    figure = Figure(figsize=(1.9 * columns, 1.85 * rows), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False)
    for row, shot in zip(grid, film.shots, strict=True):
        artist = _Artist(film, shot)
        for frame, axes in enumerate(row):
            artist.draw(axes, frame)
        row[0].set_title(figure_text(shot.title), loc="left", fontsize=9, fontweight="bold")
    file = io.BytesIO()
    figure.savefig(file, format=kind, dpi=110)
    return file.getvalue()


def stick_frames(film: Film) -> Iterator[NDArray[np.uint8]]:
    """Yields each frame, ``(height, width, 3)``."""
    figure = Figure(figsize=(len(film.shots) * WIDTH / 100, HEIGHT / 100), dpi=100)
    artists = [_Artist(film, shot) for shot in film.shots]
    for frame in range(len(film.time)):
        figure.clear()
        row = figure.subplots(1, len(film.shots), squeeze=False)[0]
        figure.subplots_adjust(left=0.01, right=0.99, bottom=0.07, top=0.93, wspace=0.03)
        for axes, artist in zip(row, artists, strict=True):
            artist.draw(axes, frame)
            axes.set_title(
                "\n".join(map(figure_text, textwrap.wrap(artist.shot.title, 54))), fontsize=10
            )
        file = io.BytesIO()
        figure.savefig(file, format="rgba")
        pixels = np.frombuffer(file.getvalue(), dtype=np.uint8)
        yield pixels.reshape(HEIGHT, len(film.shots) * WIDTH, 4)[..., :3].copy()


class _Artist:
    """Draws the frames of one motion."""

    def __init__(self, film: Film, shot: Shot) -> None:
        self.shot = shot
        self._film = film
        self._data = mujoco.MjData(film.model)
        self._targets, self._plane, self._reach = gaze(film, shot), plane_of(film), size(film)

    def draw(self, axes: Axes, frame: int) -> None:
        """Draws a frame with its caption below."""
        film, data, centre, held = (
            self._film,
            self._data,
            self._targets[frame],
            self.shot.held[frame],
        )
        data.qpos = self.shot.qpos[frame]
        mujoco.mj_kinematics(film.model, data)
        draw_ground(axes, film.normal, centre, self._plane, self._reach)
        draw(axes, film, lines_of(film, data, centre, self._plane), held=bool(held))
        axes.set_xlim(-1.3 * self._reach, 1.3 * self._reach)
        axes.set_ylim(-1.0 * self._reach, 1.0 * self._reach)
        axes.set_aspect("equal")
        axes.set_xticks([])
        axes.set_yticks([])
        when = caption(film, self.shot, frame)
        axes.set_xlabel(
            f"{when}, not observed" if held else when,
            fontsize=8,
            color="#b01818" if held else "black",
        )
