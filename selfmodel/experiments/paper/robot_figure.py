"""Figure 1 of the paper's experiment: the robots from the side and from above."""

from collections.abc import Iterator, Sequence
from typing import Any

import mujoco
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from scipy.spatial import ConvexHull

from selfmodel.arrays import FloatArray
from selfmodel.experiments.study.drawing import COLOURS, figure_style
from selfmodel.robot.robot import Robot

SIDE = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]).T
"""Right, up and towards the viewer in a picture from the side, the columns, ``(3, 3)``."""

ABOVE = np.eye(3)
"""Right, up and towards the viewer in a picture from above."""

CORNERS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
TURNS = np.linspace(0, 2 * np.pi, 24, endpoint=False)
CIRCLE = np.stack([np.cos(TURNS), np.sin(TURNS)], axis=1)

OPEN: dict[str, Any] = {"markersize": 9.5, "markerfacecolor": "none", "markeredgewidth": 1.3}
JOINT: dict[str, Any] = {"marker": "o", "color": COLOURS[1], "markersize": 4.5}
TOUCH: dict[str, Any] = {**OPEN, "marker": "^", "color": COLOURS[2]}
ANGLE: dict[str, Any] = {**OPEN, "marker": "o", "color": COLOURS[0]}


@figure_style()
def of_robots(robots: Sequence[Robot]) -> Figure:
    """Returns Figure 1: a row per robot in its standing pose, with its joints and sensors."""
    figure = Figure(figsize=(8.4, 0.7 + 2.5 * len(robots)), layout="constrained")
    panels = figure.subplots(len(robots), 2, squeeze=False)
    for row, robot in zip(panels, robots, strict=True):
        names = robot.anatomy.names
        data = mujoco.MjData(robot.model)
        mujoco.mj_forward(robot.model, data)
        for axes, plane, view in ((row[0], SIDE, "from the side"), (row[1], ABOVE, "from above")):
            _draw(axes, robot, data, plane)
            axes.set_title(f"{robot.name}, {view}", fontsize=10)
        row[0].set_xlabel(
            f"{len(robot.anatomy.joints)} joints, {len(names.hinges)} degrees of freedom, "
            f"{len(names.sensors)} sensors",
            fontsize=9,
        )
        row[1].set_xlabel("forward is to the right; m", fontsize=9)
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
    return figure


def _draw(axes: Axes, robot: Robot, data: mujoco.MjData, plane: FloatArray) -> None:
    for outline, colour, depth in _outlines(robot.model, data, plane):
        axes.fill(*outline.T, facecolor=colour, edgecolor="0.25", linewidth=0.6, zorder=depth)
    hinges = [joint.hinges[0] for joint in robot.anatomy.joints]
    angles = [sensor.hinge for sensor in robot.anatomy.sensors if sensor.kind == "angle"]
    touch = [sensor.name for sensor in robot.anatomy.sensors if sensor.kind == "touch"]
    for positions, style, label in (
        ([data.joint(name).xanchor for name in hinges], JOINT, "joint"),
        ([data.joint(name).xanchor for name in angles], ANGLE, "angle sensor"),
        ([_site(robot.model, data, name) for name in touch], TOUCH, "touch sensor"),
    ):
        shown = np.array(positions).reshape(-1, 3) @ plane[:, :2]
        x, y = shown.T
        axes.add_line(Line2D(x, y, linestyle="none", label=label, zorder=1000, **style))
    axes.set_aspect("equal")
    axes.spines[["top", "right"]].set_visible(False)
    axes.margins(0.08)


def _site(model: mujoco.MjModel, data: mujoco.MjData, sensor: str) -> FloatArray:
    """Returns the position of the site of a touch sensor, ``(3,)``, m."""
    position: FloatArray = data.site_xpos[model.sensor(sensor).objid[0]]
    return position


def _outlines(
    model: mujoco.MjModel, data: mujoco.MjData, plane: FloatArray
) -> Iterator[tuple[FloatArray, str, int]]:
    """Yields the outline of each geom in a plane, ``(n, 2)``, m, its colour, and its depth."""
    bodies = np.flatnonzero(model.geom_bodyid > 0)
    order = np.argsort(data.geom_xpos[bodies] @ plane[:, 2])
    for depth, geom in enumerate(bodies[order], start=2):
        points = _points(model, data, int(geom), plane)
        is_root = model.body_parentid[model.geom_bodyid[geom]] == 0
        yield points[ConvexHull(points).vertices], "0.78" if is_root else "0.92", depth


def _points(model: mujoco.MjModel, data: mujoco.MjData, geom: int, plane: FloatArray) -> FloatArray:
    """Returns points in a plane, the convex hull of which is the outline of a geom, ``(n, 2)``.

    Capsules and spheres are exact, other geoms are drawn as their bounding boxes.
    """
    rotation, centre = data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom]
    kind, size = mujoco.mjtGeom(int(model.geom_type[geom])), model.geom_size[geom]
    if kind in (mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_SPHERE):
        half = rotation[:, 2] * (size[1] if kind == mujoco.mjtGeom.mjGEOM_CAPSULE else 0.0)
        ends = np.stack([centre - half, centre + half]) @ plane[:, :2]
        found: FloatArray = (ends[:, None] + size[0] * CIRCLE).reshape(-1, 2)
        return found
    middle, reach = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
    corners: FloatArray = (centre + (middle + CORNERS * reach) @ rotation.T) @ plane[:, :2]
    return corners
