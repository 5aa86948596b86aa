"""Stick figures by matplotlib, which need no OpenGL: a strip of pictures, or frames of a film."""

import io
import textwrap
from collections.abc import Iterator

import mujoco
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from selfmodel.arrays import FloatArray
from selfmodel.cli.film import HEIGHT, LINE_LENGTH, WIDTH, Film, Shot
from selfmodel.cli.output import figure_text
from selfmodel.robot.motion import shapes_of, stick_geoms

CORNERS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
EDGES = np.array(
    [(i, j) for i in range(8) for j in range(i) if (CORNERS[i] == CORNERS[j]).sum() == 2]
)
TURNS = np.linspace(0, 2 * np.pi, 12, endpoint=False)
CIRCLE = np.stack([np.cos(TURNS), np.sin(TURNS)], axis=1)

GRID = 0.5
"""Distance between the lines on the ground, m; at least a hundredth of a robot's size."""

STYLES = {"detached": ("0.6", ":"), "whole": ("#20435f", "-"), "jammed": ("#c22020", "-")}
"""Colour and style of the lines of a body."""


def strip(film: Film, kind: str) -> bytes:
    """Returns a figure file, such as ``png``, with a row per motion and a column per frame."""
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
            lines = textwrap.wrap(artist.shot.title, LINE_LENGTH)
            axes.set_title("\n".join(map(figure_text, lines)), fontsize=10)
        file = io.BytesIO()
        figure.savefig(file, format="rgba")
        pixels = np.frombuffer(file.getvalue(), dtype=np.uint8)
        yield pixels.reshape(HEIGHT, len(film.shots) * WIDTH, 4)[..., :3].copy()


class _Artist:
    """Draws the frames of one motion."""

    def __init__(self, film: Film, shot: Shot) -> None:
        self.shot = shot
        self._film, self._data = film, mujoco.MjData(film.model)
        self._targets, self._plane, self._reach = film.gaze(shot), film.plane, film.size
        self._shapes = shapes_of(film.model, np.flatnonzero(film.own & stick_geoms(film.model)))

    def draw(self, axes: Axes, frame: int) -> None:
        """Draws a frame with its caption below: what is detached dotted, what is jammed red.

        The lines are the axes of capsules and cylinders, the rims of spheres, and the edges of the
        bounding boxes of other geoms; pale where the pose is that of another time.
        """
        film, centre, reach = self._film, self._targets[frame], self._reach
        held = bool(self.shot.held[frame])
        self._data.qpos = self.shot.qpos[frame]
        mujoco.mj_kinematics(film.model, self._data)
        draw_ground(axes, film.normal, centre, self._plane, reach)
        lines = self._lines()
        for name in filter(lines.get, STYLES):
            colour, style = STYLES[name]
            axes.add_collection(
                LineCollection(
                    list((np.concatenate(lines[name]) - centre) @ self._plane),
                    colors=colour,
                    linestyles=style,
                    linewidths=1.5,
                    alpha=0.35 if held else 1.0,
                    capstyle="round",
                )
            )
        axes.set(xlim=(-1.3 * reach, 1.3 * reach), ylim=(-reach, reach), xticks=[], yticks=[])
        axes.set_aspect("equal")
        text = film.caption(self.shot, frame) + (", not observed" if held else "")
        axes.set_xlabel(text, fontsize=8, color="#b01818" if held else "black")

    def _lines(self) -> dict[str, list[FloatArray]]:
        """Returns the lines of the robot by style, each ``(lines, 2, 3)``, m."""
        film, data = self._film, self._data
        lines: dict[str, list[FloatArray]] = {}
        for shape in self._shapes:
            place, rotation = data.geom_xpos[shape.geom], data.geom_xmat[shape.geom].reshape(3, 3)
            if shape.kind in ("capsule", "cylinder"):
                half = rotation[:, 2] * shape.size[1]
                ends = np.stack([place - half, place + half])[np.newaxis]
            elif shape.kind == "sphere":
                rim = place + shape.size[0] * CIRCLE @ self._plane.T
                ends = np.stack([np.roll(rim, 1, axis=0), rim], axis=1)
            else:
                middle, extent = film.model.geom_aabb[shape.geom].reshape(2, 3)
                ends = (place + (middle + CORNERS * extent) @ rotation.T)[EDGES]
            style = "jammed" if shape.body in film.jammed else "whole"
            style = "detached" if shape.body in film.detached else style
            lines.setdefault(style, []).append(ends)
        return lines


def draw_ground(
    axes: Axes, normal: FloatArray, centre: FloatArray, plane: FloatArray, reach: float
) -> None:
    """Draws a grid on the ground around a point."""
    grid = max(GRID, reach / 100)
    low = np.floor((centre[:2] - 3 * reach) / grid) * grid
    high = centre[:2] + 3 * reach
    xs, ys = (np.arange(a, b + grid, grid) for a, b in zip(low, high, strict=True))
    across = [[(x, low[1], 0.0), (x, high[1], 0.0)] for x in xs]
    along = [[(low[0], y, 0.0), (high[0], y, 0.0)] for y in ys]
    lines = np.array(across + along)
    lines[..., 2] = -(lines[..., :2] @ normal[:2]) / normal[2]
    ends = list((lines - centre) @ plane)
    axes.add_collection(LineCollection(ends, colors="0.85", linewidths=0.6, zorder=0))
