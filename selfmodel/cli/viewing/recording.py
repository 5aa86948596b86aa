"""A logged trial and its simulation as a recording of Rerun: both bodies, joints and errors."""

from typing import Any

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.cli.rendering.film import Film, Shot
from selfmodel.cli.viewing.rerun_view import import_rerun
from selfmodel.cli.viewing.shapes import Colour, shape_of, xyzw
from selfmodel.robot.visible_geoms import visible_geoms
from selfmodel.simulation.trial_replay import Replay
from selfmodel.trials.behaviour import Behaviour

TIMELINE = "trial time"
"""Timeline of the recording: time since the start of the trial, s."""

LOGGED, SIMULATED = "logged", "simulated"
"""Names of the two bodies in paths of entities, such as ``/world/logged/torso``."""

COLOURS: dict[str, Colour] = {LOGGED: (70, 110, 150, 255), SIMULATED: (230, 120, 20, 255)}
DETACHED: Colour = (170, 170, 170, 255)
JAMMED: Colour = (200, 40, 40, 255)


def fill_recording(
    recording: Any,  # noqa: ANN401  # a RecordingStream
    film: Film,
    logged: Behaviour,
    found: Replay,
    about: str,
) -> None:
    """Sends both bodies, the joints and the errors of a trial to a recording, and its layout.

    Args:
        recording: The recording, a ``rerun.RecordingStream``.
        film: Poses of the logged and of the simulated body, in this order, at every step.
        logged: Logged signals.
        found: The simulation, compared with them.
        about: Text about the trial and the hypothesis, as Markdown.
    """
    rr = import_rerun()
    recording.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    recording.log("about", rr.TextDocument(about, media_type="text/markdown"), static=True)
    for name, shot in zip((LOGGED, SIMULATED), film.shots, strict=True):
        _send_body(recording, film, shot, name)
    for name, behaviour in ((LOGGED, logged), (SIMULATED, found.simulated)):
        angles = behaviour["joint_positions"]
        for column, hinge in enumerate(behaviour.names.columns("joint_positions")):
            path = ("joints", hinge, name)
            _send_line(recording, path, film.time, angles[:, column], [COLOURS[name]])
    for signal, errors in found.errors.items():
        _send_line(recording, ("errors", signal), film.time, errors, None)
    recording.send_blueprint(_layout(film))


def _send_body(recording: Any, film: Film, shot: Shot, name: str) -> None:  # noqa: ANN401  # Rerun
    """Sends the shapes of a body once, and its pose at every step."""
    rr = import_rerun()
    model = film.model
    drawn = visible_geoms(model)
    positions, turns = _poses(model, shot.qpos)
    times = rr.TimeColumn(TIMELINE, duration=film.time)
    for body in np.flatnonzero(model.body_rootid == model.body_rootid[film.root]):
        path = ("world", name, model.body(body).name or f"body_{body}")
        moved = rr.Transform3D.columns(
            translation=positions[:, body], quaternion=xyzw(turns[:, body])
        )
        recording.send_columns(rr.new_entity_path(path), [times], moved)
        colour = COLOURS[name]
        if body in film.detached:
            colour = DETACHED
        elif body in film.jammed:
            colour = JAMMED
        for geom in np.flatnonzero((model.geom_bodyid == body) & drawn):
            shape = shape_of(model, int(geom), colour, transparent=name == SIMULATED)
            if shape is not None:
                recording.log(rr.new_entity_path((*path, f"geom_{geom}")), shape, static=True)


def _poses(model: mujoco.MjModel, qpos: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Returns position and quaternion of each body, ``(steps, nbody, 3)`` and ``(…, 4)``."""
    data = mujoco.MjData(model)
    positions = np.empty((len(qpos), model.nbody, 3))
    turns = np.empty((len(qpos), model.nbody, 4))
    for step, pose in enumerate(qpos):
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        positions[step], turns[step] = data.xpos, data.xquat
    return positions, turns


def _send_line(
    recording: Any,  # noqa: ANN401  # Rerun
    path: tuple[str, ...],
    time: FloatArray,
    values: FloatArray,
    colours: list[Colour] | None,
) -> None:
    """Sends a number per step as a line of a plot; a missing number is a gap."""
    rr = import_rerun()
    entity = rr.new_entity_path(path)
    recording.log(entity, rr.SeriesLines(names=[", ".join(path[1:])], colors=colours), static=True)
    times = rr.TimeColumn(TIMELINE, duration=time)
    recording.send_columns(entity, [times], rr.Scalars.columns(scalars=values))


def _layout(film: Film) -> Any:  # noqa: ANN401  # Rerun
    """Returns the views: the world, the joints, the errors and the text."""
    rr = import_rerun()
    rrb = rr.blueprint
    root = rr.new_entity_path(("world", LOGGED, film.model.body(film.root).name))
    ground = rr.components.Plane3D(normal=film.normal, distance=0.0)
    no_legend = rrb.PlotLegend(visible=False)  # it would cover the lines, which tell their names
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Spatial3DView(
                origin="world",
                name="solid: logged; transparent: simulated",
                line_grid=rrb.LineGrid3D(visible=True, plane=ground),
                eye_controls=rrb.EyeControls3D(tracking_entity=root),
            ),
            rrb.Vertical(
                rrb.TimeSeriesView(
                    origin="joints", name="joint positions, rad", plot_legend=no_legend
                ),
                rrb.TimeSeriesView(
                    origin="errors", name="root mean square errors, SI units", plot_legend=no_legend
                ),
                rrb.TextDocumentView(origin="about", name="trial"),
                row_shares=[3, 2, 1],
            ),
            column_shares=[3, 2],
        ),
        collapse_panels=True,
    )
