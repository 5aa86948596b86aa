"""``selfmodel view``: a logged trial and its simulation in Rerun, and the log in Foxglove."""

import os
import socket
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.cli.commands import View
from selfmodel.cli.film import Film, film_of
from selfmodel.cli.inputs import check_new_file
from selfmodel.cli.logs import layout_path
from selfmodel.cli.output import print_json, print_lines, print_notes
from selfmodel.cli.replay import ReplayedLog, replayed_log
from selfmodel.errors import InputError, WorkError
from selfmodel.logs.files import replace_file
from selfmodel.robot import motion
from selfmodel.rotation import rotated
from selfmodel.simulation.trial_replay import Replay

HOST = "127.0.0.1"
"""Address of the viewer: this computer alone."""

SECONDS = 60.0
"""Longest wait until the viewer listens, some 10 s from a slow disk, and until it has all: a viewer
that ended never has it."""

LOGGED, SIMULATED = "logged", "simulated"
"""Names of the two bodies in paths of entities, such as ``/world/logged/torso``."""

Colour = tuple[int, int, int, int]
"""Red, green, blue and opacity, 0 to 255."""

COLOURS: dict[str, Colour] = {LOGGED: (70, 110, 150, 255), SIMULATED: (230, 120, 20, 255)}
DETACHED: Colour = (170, 170, 170, 255)
JAMMED: Colour = (200, 40, 40, 255)


def view(options: View) -> None:
    """Open a logged trial in Rerun: the body as logged, and as simulated under a hypothesis."""
    out = options.out
    if out is None:
        check_display()
    else:
        check_new_file(out, ".rrd")
    import_rerun()  # a missing package is an error before any work is done
    given = replayed_log(options, options.hypothesis)
    found = given.drawable()
    if found.diverged:
        print_notes("note: the simulation diverged: with this hypothesis the model is unstable")
    written = None
    if out is None:
        open_viewer(given, found, options.port)
    else:
        written = write_recording(out, given, found)
    layout = layout_path()
    if options.as_json:
        facts = {
            "log": str(options.file),
            "robot": given.robot.name,
            "hypothesis": str(given.hypothesis),
            "steps": given.log.trial.trajectory.steps,
            "diverged": found.diverged,
            "out": str(out) if out else None,
            "bytes": written,
            "foxglove_layout": str(layout),
        }
        print_json(facts)
        return
    body = f"{given.robot.name} as logged, and simulated as {given.hypothesis}, transparent"
    print_lines(
        f"{out}: {body}; open it with `rerun {out}`." if out else f"Rerun shows {body}.",
        f"In Foxglove or Lichtblick: open the local file {options.file}, then import the layout "
        f"{layout}.",
        "The layout's plots of legs are of the quadruped: other robots need their own indices.",
    )


def write_recording(out: Path, given: ReplayedLog, found: Replay) -> int:
    """Writes a trial and its simulation as a file of Rerun and returns its number of bytes."""
    recording = import_rerun().RecordingStream("selfmodel")
    with tempfile.TemporaryDirectory() as folder:
        part = Path(folder) / "recording.rrd"
        recording.save(part)
        fill_recording(recording, given, found)
        recording.disconnect()  # the file is complete
        data = part.read_bytes()
    replace_file(out, data)
    return len(data)


def open_viewer(given: ReplayedLog, found: Replay, port: int) -> None:
    """Shows a trial and its simulation in the viewer that has the port, or in a new one.

    Raises:
        WorkError: The viewer did not start, was closed before it had the recording, or another
            program has the port.
    """
    recording = import_rerun().RecordingStream("selfmodel")
    if not is_listening(port):
        _start_viewer(port)
    recording.connect_grpc(f"rerun+http://{HOST}:{port}/proxy")
    fill_recording(recording, given, found)
    try:
        recording.flush(timeout_sec=SECONDS)
    except RuntimeError as error:
        raise WorkError(
            f"Rerun's viewer ended before it had the recording, or port {port} is that of another "
            f"program: {error}; choose another with --port N, or write a file with -o NAME.rrd"
        ) from error


def _start_viewer(port: int) -> None:
    """Starts a viewer, which goes on after this process, and waits until it listens.

    Raises:
        WorkError: It did not start.
    """
    null = subprocess.DEVNULL  # a reader of this command's output waits for no viewer
    command = viewer_command(port)
    viewer = subprocess.Popen(  # noqa: S603  # Rerun's own command
        command, stdin=null, stdout=null, stderr=null, start_new_session=True
    )
    end = monotonic() + SECONDS
    while not is_listening(port):
        if viewer.poll() is not None:
            raise WorkError(
                f"Rerun's viewer did not start: it ended with status {viewer.returncode}; write a "
                f"file with -o NAME.rrd instead"
            )
        if monotonic() > end:
            viewer.kill()
            viewer.wait()
            raise WorkError(f"Rerun's viewer did not listen on port {port} in {SECONDS:g} s")
        sleep(0.05)


def viewer_command(port: int) -> list[str]:
    """Returns the command of a viewer that listens on this computer alone, unlike rerun.spawn's."""
    # -P: a folder such as rerun_cli in the current folder is not imported.
    command = [sys.executable, "-P", "-m", "rerun_cli", "--bind", HOST, "--port", str(port)]
    # As rerun.spawn has them: the share of the memory, and no welcome before the recording.
    return [*command, "--memory-limit", "75%", "--expect-data-soon"]


def is_listening(port: int, host: str = HOST) -> bool:
    """Returns whether a program listens on a port."""
    with socket.socket() as tried:
        tried.settimeout(1.0)
        return tried.connect_ex((host, port)) == 0


def import_rerun() -> Any:  # noqa: ANN401  # an extra
    """Returns the module ``rerun``.

    Raises:
        InputError: It is not installed.
    """
    try:
        import rerun  # noqa: PLC0415  # an extra
        import rerun.blueprint  # noqa: PLC0415
    except ImportError as error:
        raise InputError(
            "Rerun is not installed: pip install 'selfmodel[rerun]' (0.8 GB on the disk)"
        ) from error
    return rerun


def check_display(environment: Mapping[str, str] = os.environ) -> None:
    """Raises ``InputError`` where no window can be opened: on Linux without a display."""
    if sys.platform == "linux" and not any(map(environment.get, ("DISPLAY", "WAYLAND_DISPLAY"))):
        raise InputError(
            "there is no display to open Rerun on: write a file with -o NAME.rrd, and open it with "
            "`rerun NAME.rrd` where there is one"
        )


def fill_recording(recording: Any, given: ReplayedLog, found: Replay) -> None:  # noqa: ANN401  # Rerun
    """Sends both bodies, the joints and the errors of a trial to a ``rerun.RecordingStream``."""
    rr = import_rerun()
    logged = given.log.trial.trajectory
    motions = [(LOGGED, logged), (SIMULATED, found.simulated)]
    film = film_of(given.robot, given.hypothesis, motions, np.asarray(logged.time))
    about = (
        f"**{given.robot.name}**, trial {given.log.trial.plan.name}\n\n"
        f"- solid: as logged\n"
        f"- transparent: simulated as `{given.hypothesis}` with the logged controller\n"
        f"- grey: detached by the hypothesis; red: jammed by it\n"
    )
    recording.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    recording.log("about", rr.TextDocument(about, media_type="text/markdown"), static=True)
    times = [rr.TimeColumn("trial time", duration=film.time)]

    def send_line(path: tuple[str, ...], values: FloatArray, colour: Colour | None = None) -> None:
        """Sends a number per step as a line of a plot; a missing number is a gap."""
        entity = rr.new_entity_path(path)
        colours = None if colour is None else [colour]
        line = rr.SeriesLines(names=[", ".join(path[1:])], colors=colours)
        recording.log(entity, line, static=True)
        recording.send_columns(entity, times, rr.Scalars.columns(scalars=values))

    for shot, (name, trajectory) in zip(film.shots, motions, strict=True):
        _send_body(recording, film, shot.qpos, name, times)
        angles = trajectory["joint_positions"]
        for column, hinge in enumerate(trajectory.names.columns("joint_positions")):
            send_line(("joints", hinge, name), angles[:, column], COLOURS[name])
    for signal, errors in found.errors.items():
        send_line(("errors", signal), errors)
    recording.send_blueprint(_layout(film))


def _send_body(recording: Any, film: Film, qpos: FloatArray, name: str, times: list[Any]) -> None:  # noqa: ANN401  # Rerun
    """Sends the shapes of a body once, and its pose at every step."""
    rr = import_rerun()
    model = film.model
    poses = motion.body_poses(mujoco.MjData(model), qpos)
    paths: dict[int, tuple[str, ...]] = {}
    for body in motion.bodies_of(model, model.body(film.root).name):
        path = ("world", name, model.body(body).name or f"body_{body}")
        moved = rr.Transform3D.columns(
            translation=poses[:, body, :3], quaternion=xyzw(poses[:, body, 3:])
        )
        recording.send_columns(rr.new_entity_path(path), times, moved)
        paths[int(body)] = path
    shown = motion.visible_geoms(model) & film.own
    for shape in motion.shapes_of(model, np.flatnonzero(shown)):
        colour = JAMMED if shape.body in film.jammed else COLOURS[name]
        colour = DETACHED if shape.body in film.detached else colour
        drawn = archetype(model, shape, colour, transparent=name == SIMULATED)
        entity = rr.new_entity_path((*paths[shape.body], f"geom_{shape.geom}"))
        recording.log(entity, drawn, static=True)


def archetype(
    model: mujoco.MjModel, shape: motion.Shape, colour: Colour, *, transparent: bool
) -> Any:  # noqa: ANN401  # one of several archetypes
    """Returns a shape in the frame of its body as an archetype of Rerun.

    A transparent one has edges, but for a mesh, which always has faces.
    """
    rr = import_rerun()
    place, turn, size = shape.position, shape.quaternion, shape.size
    if shape.kind == "mesh":
        vertices, faces = motion.triangles_of(model, shape.mesh)
        return rr.Mesh3D(
            vertex_positions=rotated(vertices, turn) + place,
            triangle_indices=faces,
            albedo_factor=colour,
        )
    modes = rr.components.FillMode
    fill = modes.TransparentFillMajorWireframe if transparent else modes.Solid
    look = {"colors": [colour], "fill_mode": fill, "quaternions": [xyzw(turn)]}
    round_ = {"lengths": [2 * size[1]], "radii": [size[0]]}
    match shape.kind:
        case "capsule":
            # A capsule of Rerun begins at its origin; MuJoCo's has the origin in the middle.
            start = place - rotated(np.array([0.0, 0.0, size[1]]), turn)
            return rr.Capsules3D(translations=[start], **round_, **look)
        case "cylinder":
            return rr.Cylinders3D(centers=[place], **round_, **look)
        case "sphere" | "ellipsoid":
            half = np.repeat(size[0], 3) if shape.kind == "sphere" else size
            return rr.Ellipsoids3D(half_sizes=[half], centers=[place], **look)
    return rr.Boxes3D(half_sizes=[size], centers=[place], **look)


def xyzw(quaternions: FloatArray) -> FloatArray:
    """Returns quaternions of MuJoCo, ``(..., 4)`` with w first, in Rerun's order, w last."""
    return np.roll(quaternions, -1, axis=-1)


def _layout(film: Film) -> Any:  # noqa: ANN401  # Rerun
    """Returns the views: the world, the joints, the errors and the text."""
    rr = import_rerun()
    rrb = rr.blueprint
    root = rr.new_entity_path(("world", LOGGED, film.model.body(film.root).name))
    ground = rr.components.Plane3D(normal=film.normal, distance=0.0)
    no_legend = rrb.PlotLegend(visible=False)  # it would cover the lines, which tell their names
    plots = (("joints", "joint positions, rad"), ("errors", "root mean square errors, SI units"))
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Spatial3DView(
                origin="world",
                name="solid: logged; transparent: simulated",
                line_grid=rrb.LineGrid3D(visible=True, plane=ground),
                eye_controls=rrb.EyeControls3D(tracking_entity=root),
            ),
            rrb.Vertical(
                *(
                    rrb.TimeSeriesView(origin=origin, name=name, plot_legend=no_legend)
                    for origin, name in plots
                ),
                rrb.TextDocumentView(origin="about", name="trial"),
                row_shares=[3, 2, 1],
            ),
            column_shares=[3, 2],
        ),
        collapse_panels=True,
    )
