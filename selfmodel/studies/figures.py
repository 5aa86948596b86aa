"""Figures of studies, with numbers of runs in them, in the style of one file: PNG, PDF and SVG."""

import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import mujoco
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.spatial import ConvexHull

from selfmodel.arrays import FloatArray
from selfmodel.errors import InputError, counted, typed
from selfmodel.robot.robot import Robot
from selfmodel.studies.recoveries import ENDS, robot_key
from selfmodel.studies.rows import failure_of, label_of, methods_of, whole
from selfmodel.studies.study import Row, grouped
from selfmodel.style import (
    COLOURS,
    REFERENCE,
    Style,
    errorbars,
    figure_style,
    files_of,
    folded,
    given_width,
    legend_below,
    look,
    panels_of,
    row_label,
    text_size,
)

SLOT = 0.8
"""Width of all lines of one case in Figure 5; the distance between two cases is 1."""

VIEWS = {"from the side": np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]).T, "from above": np.eye(3)}
"""Right, up and towards the viewer of a picture, the columns, ``(3, 3)``."""

CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
TURNS = np.linspace(0, 2 * np.pi, 24, endpoint=False)
CIRCLE = np.stack([np.cos(TURNS), np.sin(TURNS)], axis=1)


def of_ablation(rows: Sequence[Row], scores: Sequence[Row]) -> dict[str, bytes]:
    """Returns the files of the figures of an ablation by their name; none without rows."""
    files = files_of("gap", by_gap(scores)) if rows else {}
    ends = _first_and_last(rows)
    named = [{**row, "method": name} for row, name in zip(rows, methods_of(rows), strict=True)]
    for (robot, trials), same in sorted(grouped(named, "robot", "trials").items()):
        if trials in ends:
            name = f"cases-{robot_key(robot)}-{trials}"
            files |= files_of(name, by_case(robot, trials, same))
    return files


@figure_style()
def by_gap(scores: Sequence[Row]) -> Figure:
    """Returns right diagnoses by gap: a panel per robot and trial count, a line per method.

    Methods of one comparator, which differ in their search, have one colour. The legend has the
    number n of diagnoses per point of each line.
    """
    robots, gaps, methods = (
        sorted({score[name] for score in scores}) for name in ("robot", "gap", "method")
    )
    comparators = grouped(scores, "comparator").values()
    looks = {
        name: look(number, variant, len(comparators))
        for number, own in enumerate(comparators)
        for variant, name in enumerate(_distinct(own, "method"))
    }
    ends = _first_and_last(scores)
    counts = len(robots) * len(ends), len(ends)
    figure, panels = panels_of(
        *counts, size=(4.2, 2.4 if given_width.get() else 3.2), margin=(1, 0.8), share=True
    )
    spread = 0.012 * (max(gaps) - min(gaps) or 1)  # error bars side by side
    for axes, (robot, trials) in zip(panels, itertools.product(robots, ends), strict=True):
        for number, name in enumerate(methods):  # the same look in panels without all of them
            own = [one for one in scores if one["method"] == name]
            shift = spread * (number - (len(methods) - 1) / 2)
            points = [
                (one["gap"] + shift, share.estimate, share.low, share.high)
                for one in own
                if (one["robot"], one["trials"]) == (robot, trials)
                for share in [one["correct"]]
            ]
            if points:
                label = f"{name} ({counts_text(one['runs'] for one in own)})"
                errorbars(axes, points, number, label=label, **looks[name])
        axes.set(title=f"{robot}, {counted(trials, 'trial')}", ylim=(-0.03, 1.03), xticks=gaps)
        axes.grid(axis="y")
        if (place := axes.get_subplotspec()) and place.is_last_row():
            axes.set_xlabel("reality gap")
        if place and place.is_first_col():
            axes.set_ylabel("right diagnoses\n(95 % interval)")
    legend_below(figure, columns=min(2, len(methods)))
    return figure


@figure_style()
def by_case(robot: str, trials: int, rows: Sequence[Row]) -> Figure:
    """Returns right diagnoses by case and method, a panel per gap.

    The name of a method has the number n of diagnoses per square of its row.
    """
    frame = pd.DataFrame(rows)
    frame["method"] = frame["method"] if "method" in frame else methods_of(rows)
    frame["failure"] = [failure_of(row["case"], row["truth"]) for row in rows]
    gaps, cases, methods = (sorted(frame[name].unique()) for name in ("gap", "failure", "method"))
    squares = frame.groupby(["gap", "method", "failure"])["correct"]
    counts = squares.size().groupby("method")
    labels = [row_label(name, f"({counts_text(counts.get_group(name))})") for name in methods]
    figure, panels = panels_of(
        len(gaps),
        size=(0.4 + 0.42 * len(cases), 0.8 + 0.36 * len(methods)),
        margin=(1.2 + 0.09 * max(map(len, labels)), 0.6),
        share="y",
    )
    for axes, gap in zip(panels, gaps, strict=True):
        shares = squares.mean()[gap].unstack()  # noqa: PD010  # nothing to aggregate
        values = shares.reindex(index=methods, columns=cases).to_numpy(dtype=float)
        axes.imshow(values, vmin=0, vmax=1, aspect="auto")
        for (i, j), share in np.ndenumerate(values):
            if not math.isnan(share):
                colour = "white" if share < 0.5 else "black"
                style: Style = {"ha": "center", "va": "center", "color": colour}
                style["fontsize"] = text_size(0.7)
                axes.text(j, i, f"{100 * share:.0f}", **style)
        axes.set_xticks(range(len(cases)), cases)
        axes.set_yticks(range(len(methods)), labels)
        axes.spines[:].set_visible(False)
        axes.set(title=f"gap {gap:g}", xlabel="case")
    figure.suptitle(f"{robot}, {counted(trials, 'trial')}: right diagnoses, %")
    return figure


def of_suite(rows: Sequence[Row]) -> dict[str, bytes]:
    """Returns the files of a figure of the recoveries of bodies; none without a recovery."""
    runs = [row for row in rows if not row.get("reason")]
    return files_of("bodies", by_body(runs)) if runs else {}


@figure_style()
def by_body(rows: Sequence[Row]) -> Figure:
    """Returns the scores of each body and failure at the ``ENDS``, a dot per run.

    A cross in place of a dot is a trial in which the robot fell.
    """
    places = list(grouped(rows, "robot", "case", "truth").items())
    labels = [f"{robot}, {truth} ({counts_text([len(own)])})" for (robot, _, truth), own in places]
    size = (3.7 + 0.068 * max(map(len, labels)), 0.5 + 0.36 * len(places))
    figure, (axes,) = panels_of(1, 1, size=size, margin=(0.4, 0.8), share=False)
    for number, end in enumerate(ENDS):
        values: dict[bool, list[tuple[float, float]]] = {False: [], True: []}
        for place, (_, own) in enumerate(places):
            y = place + 0.24 * (number - 1)
            for row in own:
                values[row.get(f"upright_{end}") is False].append((row[end], y))
        for fell, points in values.items():
            style: Style = look(number) | {"linestyle": "none", "alpha": 0.8, "markersize": 5}
            axes.plot(
                *np.array(points, dtype=float).reshape(-1, 2).T,
                **style | ({"marker": "x"} if fell else {"label": end.replace("_", " ")}),
            )
    if any(row.get(f"upright_{end}") is False for row in rows for end in ENDS):
        axes.plot([], [], color="0.3", marker="x", linestyle="none", label="fell")
    axes.axvline(0, color="0.3", linewidth=0.8)
    axes.set_yticks(range(len(places)), labels, fontsize=text_size(0.8))
    axes.set(ylim=(len(places) - 0.5, -0.5))
    axes.set_xlabel(label_of(rows))
    axes.grid(axis="x")
    legend_below(figure, columns=4)
    return figure


def of_comparisons(comparisons: pd.DataFrame) -> dict[str, bytes]:
    """Returns the files of a figure of paired differences per robot, over all conditions."""
    shown, files = whole(comparisons), dict[str, bytes]()
    if len(shown):
        for robot, own in shown.groupby(shown["table"].str[0], sort=False):
            files |= files_of(f"differences-{robot_key(robot)}", paired_differences(own))
    return files


@typed
@figure_style()
def paired_differences(comparisons: pd.DataFrame) -> Figure:
    """Returns the mean paired difference of every pair of methods, a panel per table.

    A filled marker is a difference that the corrected tests call better; the intervals are not
    corrected. The labels have the number n of runs that both methods have. There is one comparison
    at least.
    """
    if "difference" not in comparisons or not len(comparisons):
        got = f"{counted(len(comparisons), 'row')} of {', '.join(map(str, comparisons)):.200}"
        raise InputError(f"expected rows of selfmodel.load(folder).comparisons(), got {got}")
    tables = comparisons.sort_values("difference", kind="stable").groupby("table", sort=False)
    minus = "\N{MINUS SIGN}"
    longest = (comparisons["first"] + comparisons["second"]).str.len().max() + 3
    # Proportions have one scale; metres and ratios do not.
    ends = comparisons[["difference_low", "difference_high"]]
    figure, panels = panels_of(
        len(tables),
        size=(
            3.7 + 0.068 * longest,
            0.7 + (0.28 if given_width.get() else 0.21) * tables.size().max(),
        ),
        margin=(0.4, 0.5),
        share="x" if (ends.abs() <= 1).all(axis=None) else False,
    )
    for axes, (table, rows) in zip(panels, tables, strict=True):
        axes.axvline(0, color="0.3", linewidth=0.8)
        for place, row in enumerate(rows.itertuples()):
            colour = look(0)["color"] if row.better else "0.55"
            line = row.difference_low, row.difference_high
            axes.plot(line, [place] * 2, color=colour, linewidth=1.2)
            face = colour if row.better else "white"
            style: Style = {"marker": "o", "markersize": 4.5, "markerfacecolor": face}
            axes.plot([row.difference], [place], color=colour, **style)
        labels = [
            row_label(row.first, f"{minus} {row.second} (n = {row.n})") for row in rows.itertuples()
        ]
        axes.set_yticks(range(len(rows)), labels, fontsize=text_size(0.8))
        axes.set(title=", ".join(table), ylim=(-0.7, len(rows) - 0.3))
        axes.grid(axis="x")
    text = "mean paired difference, first minus second, with 95 % interval; filled: better"
    figure.supxlabel(folded(text))
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

    ``grey`` are the cases by robot that the paper did not restore, and ``restored`` returns the
    values of the line of a recovery from its trials.
    """
    robots, comparators = (_distinct(trials, name) for name in ("robot", "comparator"))
    cases = sorted({trial["case"] for trial in trials})
    lines: dict[tuple[Any, ...], list[list[float]]] = {}
    for key, one in grouped(trials, "robot", "case", "comparator", "seed").items():
        lines.setdefault(key[:3], []).append(restored(one))
    size = (1.8 + 0.75 * max(len(cases), 4), 2.6)
    figure, panels = panels_of(len(robots), 1, size=size, margin=(0, 0.9), share="x")
    width = SLOT / len(comparators)
    for axes, robot in zip(panels, robots, strict=True):
        for place, case in enumerate(cases):
            if case in grey[robot]:
                axes.axvspan(place - 0.5, place + 0.5, color="0.9", zorder=0)
            for number, comparator in enumerate(comparators):
                values = np.array(lines.get((robot, case, comparator), []))
                values = values[np.isfinite(values).all(axis=-1)]
                if len(values):
                    middle = np.median(values, axis=0)
                    left = place - SLOT / 2 + number * width
                    x = left + width * (np.arange(len(middle)) + 0.75) / (len(middle) + 0.5)
                    style: Style = {**look(number), "markersize": 3.5}
                    axes.plot(x, middle, **style, linewidth=1.2, label=comparator)
                    # The failing trial is an open marker.
                    axes.plot(x[:1], middle[:1], **style, markerfacecolor="white")
        axes.axhline(1, **REFERENCE)
        axes.set_xticks(range(len(cases)), [str(case) for case in cases])
        counts = counts_text(len(one) for key, one in lines.items() if key[0] == robot)
        axes.set(title=f"{robot} ({counts} per line)", xlim=(-0.5, len(cases) - 0.5))
        axes.grid(axis="y")
    is_grey = any(case in grey[robot] for robot in robots for case in cases)
    legend = "; grey: not restored in the paper" if is_grey else ""
    panels[-1].set_xlabel(f"case of Table I{legend}")
    figure.supylabel("displacement ÷ before the failure")
    legend_below(figure, columns=min(3, len(comparators)))
    return figure


@figure_style()
def by_cost(costs: Sequence[Row], band: str, reported: tuple[float, float, str]) -> Figure:
    """Returns Figure 6: the function restored by the number of physical trials, per robot.

    ``costs`` are quartiles of all ways, ``band`` the way that is drawn as a line with a band, and
    ``reported`` trials, restored function, and label of the paper's own number.
    """
    robots, ways = (_distinct(costs, name) for name in ("robot", "way"))
    others = [way for way in ways if way != band]
    lines = {
        key: pd.DataFrame(own)[["physical_trials", "recovery", "low", "high"]]
        for key, own in grouped(costs, "robot", "way").items()
    }
    figure, panels = panels_of(
        len(robots), len(robots), size=(4.4, 4.0), margin=(0.8, 0), share="y"
    )
    for axes, robot in zip(panels, robots, strict=True):
        for number, way in enumerate(others):
            points = lines[robot, way].to_numpy() if (robot, way) in lines else np.empty((0, 4))
            shift = 1 + 0.06 * (number - (len(others) - 1) / 2)
            errorbars(axes, points * (shift, 1, 1, 1), number, label=way, linewidth=1.2)
        if (robot, band) in lines:
            x, middle, low, high = lines[robot, band].sort_values("physical_trials").to_numpy().T
            axes.plot(x, middle, color="black", label="evolution on the robot")
            axes.fill_between(x, low, high, color="black", alpha=0.12, linewidth=0)
        star: Style = {"marker": "*", "markersize": 11, "markerfacecolor": "white"}
        axes.plot(*reported[:2], color="black", linestyle="none", label=reported[2], **star)
        axes.axhline(1, **REFERENCE)
        axes.set(xscale="log", xlim=(0.8, 2 * reported[0]))
        axes.set_xticks([1, 3, 10, 100, 1000], ["1", "3", "10", "100", "1,000"])
        axes.minorticks_off()
        axes.set_xlabel("physical trials after the failing one")
        counts = counts_text(cost["runs"] for cost in costs if cost["robot"] == robot)
        axes.set_title(f"{robot} ({counts})")
        axes.grid(axis="y")
    panels[0].set_ylabel("displacement ÷ before the failure")
    legend_below(figure, columns=len(robots))
    return figure


@figure_style()
def robots(shown: Sequence[Robot]) -> Figure:
    """Returns Figure 1: a row per robot in its standing pose, with its joints and sensors."""
    figure, panels = panels_of(2 * len(shown), size=(4.2, 2.5), margin=(0, 0.7), share=False)
    for axes, (robot, view) in zip(panels, itertools.product(shown, VIEWS), strict=True):
        _draw_robot(axes, robot, VIEWS[view])
        anatomy = robot.anatomy
        parts = (
            f"{len(anatomy.joints)} joints, {len(anatomy.hinges)} degrees of freedom, "
            f"{len(anatomy.sensors)} sensors"
        )
        below = parts if view == "from the side" else "forward is to the right; m"
        axes.set_title(f"{robot.name}, {view}")
        axes.set_xlabel(below, fontsize=text_size(0.9))
    legend_below(figure, columns=3)
    return figure


def _draw_robot(axes: Axes, robot: Robot, plane: FloatArray) -> None:
    """Draws the outlines of the geoms, the farthest first, and the joints and sensors."""
    model, data, anatomy = robot.model, mujoco.MjData(robot.model), robot.anatomy
    mujoco.mj_forward(model, data)
    bodies = np.flatnonzero(model.geom_bodyid > 0)
    for geom in bodies[np.argsort(data.geom_xpos[bodies] @ plane[:, 2])]:
        points = _outline(model, data, int(geom), plane[:, :2])
        colour = "0.78" if model.body_parentid[model.geom_bodyid[geom]] == 0 else "0.92"
        outline = points[ConvexHull(points).vertices].T
        axes.fill(*outline, facecolor=colour, edgecolor="0.25", linewidth=0.6, zorder=2)
    angles = [one.hinge for one in anatomy.sensors if one.kind == "angle"]
    touches = [model.sensor(one.name).objid[0] for one in anatomy.sensors if one.kind == "touch"]
    hinges = [one.hinges[0] for one in anatomy.joints]
    ring: Style = {"markersize": 9.5, "markerfacecolor": "none", "markeredgewidth": 1.3}
    for number, label, marker, places, style in (
        (1, "joint", "o", [data.joint(one).xanchor for one in hinges], {"markersize": 4.5}),
        (0, "angle sensor", "o", [data.joint(one).xanchor for one in angles], ring),
        (2, "touch sensor", "^", data.site_xpos[touches], ring),
    ):
        x, y = (np.array(places).reshape(-1, 3) @ plane[:, :2]).T
        mark: Style = {"linestyle": "none", "marker": marker, "color": COLOURS[number], **style}
        axes.plot(x, y, label=label, zorder=3, **mark)
    axes.set_aspect("equal")
    axes.margins(0.08)


def _outline(
    model: mujoco.MjModel, data: mujoco.MjData, geom: int, plane: FloatArray
) -> FloatArray:
    """Returns points in a plane, whose convex hull is the outline of a geom, ``(n, 2)``, m.

    Capsules are exact, other geoms are drawn as their bounding boxes.
    """
    is_capsule = model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CAPSULE
    radius, half, _ = model.geom_size[geom]
    middle, reach = model.geom_aabb[geom].reshape(2, 3)
    local = np.array([(0, 0, -half), (0, 0, half)]) if is_capsule else middle + CORNERS * reach
    rotation = data.geom_xmat[geom].reshape(3, 3)
    points: FloatArray = (data.geom_xpos[geom] + local @ rotation.T) @ plane
    return (points[:, None] + radius * CIRCLE).reshape(-1, 2) if is_capsule else points


def counts_text(counts: Iterable[int]) -> str:
    """Returns the smallest and the largest of some numbers of runs: n = 4, or n = 4 to 12."""
    ordered = sorted(counts) or [0]
    low, high = ordered[0], ordered[-1]
    return f"n = {low}" if low == high else f"n = {low} to {high}"


def _distinct(rows: Sequence[Row], name: str) -> list[Any]:
    return list(dict.fromkeys(row[name] for row in rows))


def _first_and_last(rows: Sequence[Row]) -> list[int]:
    trials = sorted({row["trials"] for row in rows})
    return sorted({*trials[:1], *trials[-1:]})
