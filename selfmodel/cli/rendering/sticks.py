"""A robot as lines in a plane: what can be drawn without any library for three dimensions."""

from dataclasses import dataclass

import mujoco
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from selfmodel.arrays import FloatArray
from selfmodel.cli.rendering.film import Film
from selfmodel.cli.rendering.view import axes as axes_of_view

LONG = (mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_CYLINDER)
FLAT = (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD)

CORNERS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
EDGES = [(i, j) for i in range(8) for j in range(i) if (CORNERS[i] == CORNERS[j]).sum() == 2]

TURNS = np.linspace(0, 2 * np.pi, 12, endpoint=False)
CIRCLE = np.stack([np.cos(TURNS), np.sin(TURNS)], axis=1)

GRID = 0.5
"""Metres between the lines on the ground."""


@dataclass(frozen=True, eq=False)
class Lines:
    """Lines in the plane of a picture.

    Attributes:
        ends: ``(lines, 2, 2)`` beginning and end of each, right and up, m.
        bodies: ``(lines,)`` the body that each is part of.
    """

    ends: FloatArray
    bodies: FloatArray


def plane_of(film: Film) -> FloatArray:
    """Returns ``(3, 2)`` what turns a point in the world into one in the plane of a picture."""
    return np.stack(axes_of_view(film), axis=1)


def lines_of(film: Film, data: mujoco.MjData, centre: FloatArray, plane: FloatArray) -> Lines:
    """Returns a robot as lines: the axes of what is long, the rims of balls, the edges of the rest.

    Args:
        film: Whose body it is.
        data: Where its parts are.
        centre: ``(3,)`` what stands at 0 in the plane.
        plane: ``plane_of`` the film.
    """
    model = film.model
    ends: list[FloatArray] = []
    bodies: list[int] = []
    for geom in np.flatnonzero(
        model.body_rootid[model.geom_bodyid] == model.body_rootid[film.root]
    ):
        kind = mujoco.mjtGeom(int(model.geom_type[geom]))
        if kind in FLAT:
            continue
        turned = data.geom_xmat[geom].reshape(3, 3)
        if kind in LONG:
            half = turned[:, 2] * model.geom_size[geom, 1]
            found = [np.stack([data.geom_xpos[geom] - half, data.geom_xpos[geom] + half])]
        elif kind == mujoco.mjtGeom.mjGEOM_SPHERE:
            rim = data.geom_xpos[geom] + model.geom_size[geom, 0] * CIRCLE @ plane.T
            found = [rim[[i - 1, i]] for i in range(len(rim))]
        else:
            middle, reach = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
            corners = data.geom_xpos[geom] + (middle + CORNERS * reach) @ turned.T
            found = [corners[[i, j]] for i, j in EDGES]
        ends += found
        bodies += [int(model.geom_bodyid[geom])] * len(found)
    return Lines((np.array(ends).reshape(-1, 2, 3) - centre) @ plane, np.array(bodies))


def draw(axes: Axes, film: Film, lines: Lines, *, held: bool) -> None:
    """Draws a robot: what is lost dotted, what is jammed red, and all pale if not observed."""
    lost = np.isin(lines.bodies, list(film.lost))
    jammed = np.isin(lines.bodies, list(film.jammed)) & ~lost
    whole = ~lost & ~jammed
    for chosen, colour, style in (
        (lost, "0.6", ":"),
        (whole, "#20435f", "-"),
        (jammed, "#c22020", "-"),
    ):
        axes.add_collection(
            LineCollection(
                list(lines.ends[chosen]),
                colors=colour,
                linestyles=style,
                linewidths=1.5,
                alpha=0.35 if held else 1.0,
                capstyle="round",
            )
        )


def draw_ground(
    axes: Axes, normal: FloatArray, centre: FloatArray, plane: FloatArray, reach: float
) -> None:
    """Draws lines on the ground around a point, which show that the robot moves over it."""
    low = np.floor((centre[:2] - 3 * reach) / GRID) * GRID
    high = centre[:2] + 3 * reach
    across = [
        [(x, low[1], 0.0), (x, high[1], 0.0)] for x in np.arange(low[0], high[0] + GRID, GRID)
    ]
    along = [[(low[0], y, 0.0), (high[0], y, 0.0)] for y in np.arange(low[1], high[1] + GRID, GRID)]
    lines = np.array(across + along)
    lines[..., 2] = -(lines[..., :2] @ normal[:2]) / normal[2]
    axes.add_collection(
        LineCollection(
            list((lines - centre) @ plane),
            colors="0.85",
            linewidths=0.6,
            zorder=0,
        )
    )
