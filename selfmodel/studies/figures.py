"""Figures of studies, with numbers of runs in them, in the style of one file: PNG, PDF and SVG."""

import io
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
import mujoco
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from scipy.spatial import ConvexHull

from selfmodel.arrays import FloatArray
from selfmodel.robot.robot import Robot
from selfmodel.studies.recoveries import robot_key
from selfmodel.studies.rows import counted_trials, failure_of, whole
from selfmodel.studies.study import Row, grouped

STYLE = Path(__file__).with_name("figures.mplstyle")
"""Style file of matplotlib: ``matplotlib.style.use(STYLE)`` draws other figures alike."""

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#333333")
"""Colours of methods, distinguishable with colour blindness.

Source: M. Okabe and K. Ito, *Color Universal Design* (2008).
"""

Style = dict[str, Any]
"""Arguments of matplotlib."""

MARKERS = "osD^v<P*"
"""Markers of methods, one more than colours, so that no pair recurs soon."""

REFERENCE: Style = {"color": "0.35", "linestyle": "--", "linewidth": 1.0}

SLOT = 0.8
"""Width of all lines of one case in Figure 5; the distance between two cases is 1."""

SIDE = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]).T
"""Right, up and towards the viewer in a picture from the side, the columns, ``(3, 3)``."""

ABOVE = np.eye(3)
"""Right, up and towards the viewer in a picture from above."""

CORNERS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
TURNS = np.linspace(0, 2 * np.pi, 24, endpoint=False)
CIRCLE = np.stack([np.cos(TURNS), np.sin(TURNS)], axis=1)


@contextmanager
def figure_style() -> Iterator[None]:
    """Context manager in which figures are made and written with the style of ``STYLE``."""
    with mpl.rc_context(fname=STYLE):
        yield


def files_of(name: str, figure: Figure) -> dict[str, bytes]:
    """Returns a figure as PNG, PDF and SVG, the same bytes in every call.

    Args:
        name: Name of the files without an extension.
        figure: The figure.
    """
    found = {}
    with figure_style():
        for suffix, date in (("png", None), ("pdf", "CreationDate"), ("svg", "Date")):
            data = io.BytesIO()
            figure.savefig(data, format=suffix, metadata={date: None} if date else None)
            found[f"{name}.{suffix}"] = data.getvalue()
    return found


def of_ablation(rows: Sequence[Row], scores: Sequence[Row]) -> dict[str, bytes]:
    """Returns the files of the figures of an ablation by their name; none without rows."""
    files = files_of("gap", by_gap(scores)) if rows else {}
    ends = _first_and_last(rows)
    for robot in sorted({row["robot"] for row in rows}):
        for trials in ends:
            same = [row for row in rows if (row["robot"], row["trials"]) == (robot, trials)]
            if same:
                name = f"cases-{robot_key(robot)}-{trials}"
                files |= files_of(name, by_case(robot, trials, same))
    return files


@figure_style()
def by_gap(scores: Sequence[Row]) -> Figure:
    """Returns right diagnoses by gap: a panel per robot and trial count, a line per comparator.

    The legend has the number n of diagnoses per point of each line.
    """
    robots, gaps, comparators = (
        sorted({score[name] for score in scores}) for name in ("robot", "gap", "comparator")
    )
    shown = _first_and_last(scores)
    figure = Figure(figsize=(1 + 4.2 * len(shown), 0.8 + 3.2 * len(robots)), layout="constrained")
    panels = figure.subplots(len(robots), len(shown), sharex=True, sharey=True, squeeze=False)
    spread = 0.012 * (max(gaps) - min(gaps) or 1)  # error bars side by side
    handles: dict[str, Any] = {}
    for (i, robot), (j, trials) in ((r, t) for r in enumerate(robots) for t in enumerate(shown)):
        axes = panels[i, j]
        for k, comparator in enumerate(comparators):
            key = robot, comparator, trials
            line = [s for s in scores if (s["robot"], s["comparator"], s["trials"]) == key]
            if line:
                shift = spread * (k - (len(comparators) - 1) / 2)
                handles[comparator] = _errorbars(
                    axes,
                    [score["gap"] + shift for score in line],
                    [score["correct"].estimate for score in line],
                    [(score["correct"].low, score["correct"].high) for score in line],
                    k,  # the same look in panels without all comparators
                )
        axes.set_title(f"{robot}, {counted_trials(trials)}")
        axes.set_ylim(-0.03, 1.03)
        axes.set_xticks(gaps)
        axes.grid(axis="y")
        axes.tick_params(labelbottom=True)
    for axes in panels[-1]:
        axes.set_xlabel("reality gap")
    figure.supylabel("right diagnoses (95 % interval)")
    counts = {
        name: counts_text(one["runs"] for one in scores if one["comparator"] == name)
        for name in comparators
    }
    figure.legend(
        [handles[name] for name in comparators],
        [f"{name} ({counts[name]})" for name in comparators],
        loc="outside lower center",
        ncols=min(2, len(comparators)),
    )
    return figure


@figure_style()
def by_case(robot: str, trials: int, rows: Sequence[Row]) -> Figure:
    """Returns right diagnoses by case and comparator, a panel per gap.

    The name of a comparator has the number n of diagnoses per square of its row.
    """
    frame = pd.DataFrame(rows)
    frame["failure"] = [failure_of(row["case"], row["truth"]) for row in rows]
    gaps, cases, comparators = (
        sorted(frame[name].unique()) for name in ("gap", "failure", "comparator")
    )
    counts = frame.groupby(["comparator", "gap", "failure"]).size()
    labels = [f"{name} ({counts_text(counts[name])})" for name in comparators]
    figure, panels = _panels(
        len(gaps),
        width=0.4 + 0.42 * len(cases),
        height=0.8 + 0.36 * len(comparators),
        margin=(1.2 + 0.09 * max(map(len, labels)), 0.6),
        sharey=True,
    )
    for axes, gap in zip(panels, gaps, strict=True):
        shares = frame[frame["gap"] == gap].pivot_table(
            index="comparator", columns="failure", values="correct", aggfunc="mean"
        )
        values = shares.reindex(index=comparators, columns=cases).to_numpy(dtype=float)
        axes.imshow(values, vmin=0, vmax=1, cmap="viridis", aspect="auto")
        for (i, j), share in np.ndenumerate(values):
            if not math.isnan(share):
                colour = "white" if share < 0.5 else "black"
                style: Style = {"ha": "center", "va": "center", "fontsize": 7, "color": colour}
                axes.text(j, i, f"{100 * share:.0f}", **style)
        axes.set_xticks(range(len(cases)), cases)
        axes.set_yticks(range(len(comparators)), labels)
        axes.spines[:].set_visible(False)
        axes.set_title(f"gap {gap:g}", fontsize=10)
        axes.set_xlabel("case")
    figure.suptitle(f"{robot}, {counted_trials(trials)}: right diagnoses, %")
    return figure


def of_comparisons(found: pd.DataFrame) -> dict[str, bytes]:
    """Returns the files of a figure of paired differences per robot, over all conditions."""
    shown = whole(found)
    files: dict[str, bytes] = {}
    for robot in dict.fromkeys(table[0] for table in shown.get("table", ())):
        own = shown[[table[0] == robot for table in shown["table"]]]
        files |= files_of(f"differences-{robot_key(robot)}", paired_differences(own))
    return files


@figure_style()
def paired_differences(found: pd.DataFrame) -> Figure:
    """Returns the mean paired difference of every pair of methods, a panel per table.

    A filled marker is a difference that the corrected tests call better; the intervals are not
    corrected. The labels have the number n of runs that both methods have.

    Args:
        found: Comparisons of one or several tables; at least one.
    """
    own = {
        table: found[[one == table for one in found["table"]]].sort_values(
            "difference", kind="stable"
        )
        for table in dict.fromkeys(found["table"])
    }
    minus = "\N{MINUS SIGN}"
    labels = {
        table: [f"{one.first} {minus} {one.second} (n = {one.n})" for one in rows.itertuples()]
        for table, rows in own.items()
    }
    longest = max(len(label) for one in labels.values() for label in one)
    # Proportions have one scale; metres and ratios do not.
    is_shared = bool((found[["difference_low", "difference_high"]].abs() <= 1).all(axis=None))
    figure, panels = _panels(
        len(own),
        width=3.2 + 0.068 * longest,
        height=0.7 + 0.21 * max(map(len, own.values())),
        margin=(0.0, 0.5),
        sharex=is_shared,
    )
    for axes, (table, rows) in zip(panels, own.items(), strict=True):
        axes.axvline(0, color="0.3", linewidth=0.8)
        for place, one in enumerate(rows.itertuples()):
            colour = COLOURS[0] if one.better else "0.55"
            ends = [one.difference_low, one.difference_high]
            axes.plot(ends, [place, place], color=colour, linewidth=1.2)
            face = colour if one.better else "white"
            style: Style = {"marker": "o", "markersize": 4.5, "markerfacecolor": face}
            axes.plot([one.difference], [place], color=colour, **style)
        axes.set_yticks(range(len(rows)), labels[table], fontsize=8)
        axes.set_ylim(-0.7, len(rows) - 0.3)
        axes.grid(axis="x")
        axes.tick_params(labelbottom=True)
        axes.set_title(", ".join(table))
    figure.supxlabel(
        "mean paired difference, first minus second, with 95 % interval; filled: better"
    )
    return figure


@figure_style()
def by_trial(
    trials: Sequence[Row],
    grey: Mapping[str, Sequence[int]],
    restored: Callable[[Sequence[Row]], list[float]],
) -> Figure:
    """Returns Figure 5: the function restored by each trial, by case, a panel per robot.

    The line of a case and a comparator has the failing trial, then the best recovery trial so far
    after one, two and more trials: medians over the seeds.

    Args:
        trials: Physical trials of all recoveries.
        grey: Cases by robot that the paper did not restore.
        restored: Function of the trials of a recovery to the values of its line.
    """
    robots = list(dict.fromkeys(trial["robot"] for trial in trials))
    comparators = list(dict.fromkeys(trial["comparator"] for trial in trials))
    cases = sorted({trial["case"] for trial in trials})
    lines: dict[tuple[Any, ...], list[list[float]]] = {}
    for key, one in grouped(trials, "robot", "case", "comparator", "seed").items():
        lines.setdefault(key[:3], []).append(restored(one))
    size = (1.8 + 0.75 * max(len(cases), 4), 0.9 + 2.6 * len(robots))
    figure = Figure(figsize=size, layout="constrained")
    panels = figure.subplots(len(robots), 1, sharex=True, squeeze=False)[:, 0]
    width = SLOT / len(comparators)
    for axes, robot in zip(panels, robots, strict=True):
        for place, case in enumerate(cases):
            if case in grey[robot]:
                axes.axvspan(place - 0.5, place + 0.5, color="0.9", zorder=0)
            for number, comparator in enumerate(comparators):
                values = lines.get((robot, case, comparator), [])
                values = [value for value in values if not np.isnan(value).any()]
                if values:
                    middle = np.median(values, axis=0)
                    left = place - SLOT / 2 + number * width
                    x = left + width * (np.arange(len(middle)) + 0.75) / (len(middle) + 0.5)
                    style = {**look(number), "markersize": 3.5}
                    axes.plot(x, middle, **style, linewidth=1.2)
                    # The failing trial is an open marker.
                    axes.plot(x[:1], middle[:1], **style, markerfacecolor="white")
        axes.axhline(1, **REFERENCE)
        axes.set_xlim(-0.5, len(cases) - 0.5)
        axes.set_xticks(range(len(cases)), [str(case) for case in cases])
        axes.tick_params(labelbottom=True)
        counts = [len(one) for key, one in lines.items() if key[0] == robot]
        axes.set_title(f"{robot} ({counts_text(counts)} per line)")
        axes.grid(axis="y", alpha=0.3)
    is_grey = any(case in grey[robot] for robot in robots for case in cases)
    legend = "; grey: not restored in the paper" if is_grey else ""
    panels[-1].set_xlabel(f"case of Table I{legend}")
    figure.supylabel("displacement ÷ before the failure", fontsize=10)
    handles = [panels[0].plot([], [], **look(number))[0] for number in range(len(comparators))]
    columns = max(1, min(3, len(comparators)))
    figure.legend(handles, comparators, loc="outside lower center", ncols=columns)
    return figure


@figure_style()
def by_cost(costs: Sequence[Row], band: str, reported: tuple[float, float, str]) -> Figure:
    """Returns Figure 6: the function restored by the number of physical trials, per robot.

    Args:
        costs: Quartiles of all ways.
        band: The way that is drawn as a line with a band.
        reported: Trials, restored function, and label of the paper's own number.
    """
    robots = list(dict.fromkeys(cost["robot"] for cost in costs))
    ways = [way for way in dict.fromkeys(cost["way"] for cost in costs) if way != band]
    figure = Figure(figsize=(0.8 + 4.4 * len(robots), 4.0), layout="constrained")
    panels = figure.subplots(1, len(robots), sharey=True, squeeze=False)[0]
    for axes, robot in zip(panels, robots, strict=True):
        own = [cost for cost in costs if cost["robot"] == robot]
        for number, way in enumerate(ways):
            line = [cost for cost in own if cost["way"] == way]
            shift = 1 + 0.06 * (number - (len(ways) - 1) / 2)
            _errorbars(
                axes,
                [shift * cost["physical_trials"] for cost in line],
                [cost["recovery"] for cost in line],
                [(cost["low"], cost["high"]) for cost in line],
                number,
                label=way,
                linewidth=1.2,
            )
        line = sorted((c for c in own if c["way"] == band), key=lambda c: c["physical_trials"])
        if line:
            x = [cost["physical_trials"] for cost in line]
            middle = [cost["recovery"] for cost in line]
            axes.plot(x, middle, color="black", label="evolution on the robot")
            ends = ([cost[end] for cost in line] for end in ("low", "high"))
            axes.fill_between(x, *ends, color="black", alpha=0.12, linewidth=0)
        star: Style = {
            "marker": "*",
            "markersize": 11,
            "markerfacecolor": "white",
            "color": "black",
        }
        axes.plot([reported[0]], [reported[1]], linestyle="none", label=reported[2], **star)
        axes.axhline(1, **REFERENCE)
        axes.set_xscale("log")
        axes.set_xlim(0.8, 2 * reported[0])
        axes.set_xticks([1, 3, 10, 100, 1000], ["1", "3", "10", "100", "1,000"])
        axes.minorticks_off()
        axes.set_xlabel("physical trials after the failing one")
        axes.set_title(f"{robot} ({counts_text(cost['runs'] for cost in own)})")
        axes.grid(axis="y", alpha=0.3)
    panels[0].set_ylabel("displacement ÷ before the failure")
    legend = panels[0].get_legend_handles_labels()
    figure.legend(*legend, loc="outside lower center", ncols=len(robots))
    return figure


@figure_style()
def robots(shown: Sequence[Robot]) -> Figure:
    """Returns Figure 1: a row per robot in its standing pose, with its joints and sensors."""
    figure = Figure(figsize=(8.4, 0.7 + 2.5 * len(shown)), layout="constrained")
    panels = figure.subplots(len(shown), 2, squeeze=False)
    for row, robot in zip(panels, shown, strict=True):
        anatomy = robot.anatomy
        data = mujoco.MjData(robot.model)
        mujoco.mj_forward(robot.model, data)
        for axes, plane, view in ((row[0], SIDE, "from the side"), (row[1], ABOVE, "from above")):
            _draw_robot(axes, robot, data, plane)
            axes.set_title(f"{robot.name}, {view}", fontsize=10)
        row[0].set_xlabel(
            f"{len(anatomy.joints)} joints, {len(anatomy.names.hinges)} degrees of freedom, "
            f"{len(anatomy.names.sensors)} sensors",
            fontsize=9,
        )
        row[1].set_xlabel("forward is to the right; m", fontsize=9)
    legend = panels[0, 0].get_legend_handles_labels()
    figure.legend(*legend, loc="outside lower center", ncols=3)
    return figure


def _draw_robot(axes: Axes, robot: Robot, data: mujoco.MjData, plane: FloatArray) -> None:
    """Draws the outlines of the geoms, the farthest first, and the joints and sensors."""
    model = robot.model
    bodies = np.flatnonzero(model.geom_bodyid > 0)
    order = np.argsort(data.geom_xpos[bodies] @ plane[:, 2])
    for depth, geom in enumerate(bodies[order], start=2):
        points = _points(model, data, int(geom), plane)
        colour = "0.78" if model.body_parentid[model.geom_bodyid[geom]] == 0 else "0.92"
        outline = points[ConvexHull(points).vertices].T
        axes.fill(*outline, facecolor=colour, edgecolor="0.25", linewidth=0.6, zorder=depth)
    sensors = robot.anatomy.sensors
    hinges = [joint.hinges[0] for joint in robot.anatomy.joints]
    angles = [sensor.hinge for sensor in sensors if sensor.kind == "angle"]
    touch = [model.sensor(one.name).objid[0] for one in sensors if one.kind == "touch"]
    ring: Style = {"markersize": 9.5, "markerfacecolor": "none", "markeredgewidth": 1.3}
    drawn: tuple[tuple[list[FloatArray], Style, str], ...] = (
        (
            [data.joint(name).xanchor for name in hinges],
            {"marker": "o", "color": COLOURS[1], "markersize": 4.5},
            "joint",
        ),
        (
            [data.joint(name).xanchor for name in angles],
            {**ring, "marker": "o", "color": COLOURS[0]},
            "angle sensor",
        ),
        (
            [data.site_xpos[site] for site in touch],
            {**ring, "marker": "^", "color": COLOURS[2]},
            "touch sensor",
        ),
    )
    for positions, style, label in drawn:
        x, y = (np.array(positions).reshape(-1, 3) @ plane[:, :2]).T
        axes.add_line(Line2D(x, y, linestyle="none", label=label, zorder=1000, **style))
    axes.set_aspect("equal")
    axes.margins(0.08)


def _points(model: mujoco.MjModel, data: mujoco.MjData, geom: int, plane: FloatArray) -> FloatArray:
    """Returns points in a plane, the convex hull of which is the outline of a geom, ``(n, 2)``, m.

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


def look(number: int) -> dict[str, Any]:
    """Returns colour and marker of a method by its number, as arguments of matplotlib."""
    return {"color": COLOURS[number % len(COLOURS)], "marker": MARKERS[number % len(MARKERS)]}


def counts_text(counts: Iterable[int]) -> str:
    """Returns the smallest and the largest of some numbers of runs: n = 4, or n = 4 to 12."""
    ordered = sorted(counts)
    if not ordered:
        return "n = 0"
    low, high = ordered[0], ordered[-1]
    return f"n = {low}" if low == high else f"n = {low} to {high}"


def _first_and_last(rows: Sequence[Row]) -> list[int]:
    trials = sorted({row["trials"] for row in rows})
    return sorted({*trials[:1], *trials[-1:]})


def _errorbars(
    axes: Axes,
    x: Sequence[float],
    y: Sequence[float],
    ends: Sequence[tuple[float, float]],
    number: int,
    **style: Any,  # noqa: ANN401  # of matplotlib
) -> Any:  # noqa: ANN401  # a container of matplotlib
    """Draws estimates with the ends of their intervals, in the look of a method."""
    middle, limits = np.array(y), np.array(ends).reshape(-1, 2).T
    # An interval may end a rounding error inside its estimate.
    bars = np.maximum([middle - limits[0], limits[1] - middle], 0)
    drawn = {"markersize": 5, "capsize": 2, "elinewidth": 0.8, **look(number), **style}
    return axes.errorbar(x, middle, yerr=bars, **drawn)


def _panels(
    count: int,
    *,
    width: float,
    height: float,
    margin: tuple[float, float],
    sharex: bool = False,
    sharey: bool = False,
) -> tuple[Figure, list[Axes]]:
    """Returns a figure with panels in two columns, as many as are needed, sizes in inches."""
    across = min(2, count)
    down = math.ceil(count / across)
    size = (margin[0] + across * width, margin[1] + down * height)
    figure = Figure(figsize=size, layout="constrained")
    panels = list(
        figure.subplots(down, across, sharex=sharex, sharey=sharey, squeeze=False).flatten()
    )
    for axes in panels[count:]:
        axes.set_visible(False)
    return figure, panels[:count]
