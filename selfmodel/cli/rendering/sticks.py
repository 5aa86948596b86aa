"""Stick figures: a robot as lines in the plane of a picture."""

from dataclasses import dataclass

import mujoco
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from selfmodel.arrays import FloatArray
from selfmodel.cli.rendering.film import Film
from selfmodel.cli.rendering.view import axes as axes_of_view
from selfmodel.robot.visible_geoms import stick_geoms

LONG = (mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_CYLINDER)
FLAT = (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD)

CORNERS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
EDGES = [(i, j) for i in range(8) for j in range(i) if (CORNERS[i] == CORNERS[j]).sum() == 2]

TURNS = np.linspace(0, 2 * np.pi, 12, endpoint=False)
CIRCLE = np.stack([np.cos(TURNS), np.sin(TURNS)], axis=1)

GRID = 0.5
"""Distance between the lines on the ground, m."""

MAX_LINES = 1000
"""Largest number of lines on the ground in each direction; a huge robot has a wider grid."""


@dataclass(frozen=True, eq=False)
class Lines:
    """Lines in the plane of a picture.

    Attributes:
        ends: Both ends of each line, right and up, ``(lines, 2, 2)``, m.
        bodies: Id of each line's body, ``(lines,)``.
    """

    ends: FloatArray
    bodies: FloatArray


def plane_of(film: Film) -> FloatArray:
    """Returns the projection from the world to the plane of a picture, ``(3, 2)``."""
    return np.stack(axes_of_view(film), axis=1)


def lines_of(film: Film, data: mujoco.MjData, centre: FloatArray, plane: FloatArray) -> Lines:
    """Returns the lines of a robot.

    They are the axes of capsules and cylinders, the rims of spheres, and the edges of the bounding
    boxes of other geoms.

    Args:
        film: Film of the robot.
        data: State of the film's model.
        centre: World point at the origin of the plane, ``(3,)``, m.
        plane: Result of ``plane_of``.
    """
    model = film.model
    ends: list[FloatArray] = []
    bodies: list[int] = []
    own = model.body_rootid[model.geom_bodyid] == model.body_rootid[film.root]
    for geom in np.flatnonzero(own & stick_geoms(model)):
        kind = mujoco.mjtGeom(int(model.geom_type[geom]))
        if kind in FLAT:
            continue
        rotation = data.geom_xmat[geom].reshape(3, 3)
        if kind in LONG:
            half = rotation[:, 2] * model.geom_size[geom, 1]
            found = [np.stack([data.geom_xpos[geom] - half, data.geom_xpos[geom] + half])]
        elif kind == mujoco.mjtGeom.mjGEOM_SPHERE:
            rim = data.geom_xpos[geom] + model.geom_size[geom, 0] * CIRCLE @ plane.T
            found = [rim[[i - 1, i]] for i in range(len(rim))]
        else:
            middle, reach = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
            corners = data.geom_xpos[geom] + (middle + CORNERS * reach) @ rotation.T
            found = [corners[[i, j]] for i, j in EDGES]
        ends += found
        bodies += [int(model.geom_bodyid[geom])] * len(found)
    return Lines((np.array(ends).reshape(-1, 2, 3) - centre) @ plane, np.array(bodies))


def draw(axes: Axes, film: Film, lines: Lines, *, held: bool) -> None:
    """Draws a robot: detached bodies dotted, jammed ones red, a held pose pale."""
    detached = np.isin(lines.bodies, list(film.detached))
    jammed = np.isin(lines.bodies, list(film.jammed)) & ~detached
    whole = ~detached & ~jammed
    for chosen, colour, style in (
        (detached, "0.6", ":"),
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
    """Draws a grid on the ground around a point."""
    grid = GRID * max(1.0, np.ceil(6 * reach / (GRID * MAX_LINES)))
    low = np.floor((centre[:2] - 3 * reach) / grid) * grid
    high = centre[:2] + 3 * reach
    across = [
        [(x, low[1], 0.0), (x, high[1], 0.0)] for x in np.arange(low[0], high[0] + grid, grid)
    ]
    along = [[(low[0], y, 0.0), (high[0], y, 0.0)] for y in np.arange(low[1], high[1] + grid, grid)]
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
