"""``selfmodel view``: a log in Rerun, with its simulation, and how to open it in Foxglove."""

import os
import signal
import socket
import sys
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest

from selfmodel.cli import view
from selfmodel.cli.commands import Simulated
from selfmodel.cli.replay import replayed_log
from selfmodel.cli.view import HOST, LOGGED, SIMULATED, archetype, is_listening, open_viewer
from selfmodel.errors import InputError, WorkError
from selfmodel.robot.motion import shapes_of
from selfmodel.robot.robot import Robot
from selfmodel.trials.trajectory import Trajectory
from tests.helpers.command import printed, refused, succeeds

pytest.importorskip("rerun", reason="the extra rerun is not installed")

Shown = tuple[dict[tuple[str, str], list[list]], Trajectory, Trajectory]

STEPS = 20


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a short log."""
    folder = tmp_path_factory.mktemp("view")
    arguments = ("--damage", "break:front_left_knee", "--steps", str(STEPS), "--out", "a.mcap")
    succeeds("trial", "quadruped", *arguments, cwd=folder)
    return folder


@pytest.fixture(scope="module")
def shown(folder: Path) -> Shown:
    """The columns of a recording by entity and name, with the logged and simulated trajectory."""
    from rerun.chunk import RrdReader  # noqa: PLC0415  # an extra

    log, hypothesis = folder / "a.mcap", "jam:back_left_knee"
    given = ("view", "a.mcap", "--hypothesis", hypothesis, "-o", "b.rrd", "--json")
    found = printed(*given, cwd=folder)
    assert (found["hypothesis"], found["out"]) == (hypothesis, "b.rrd")
    assert found["bytes"] == (folder / "b.rrd").stat().st_size
    assert Path(found["foxglove_layout"]).is_file()
    values = {}
    for chunk in RrdReader(str(folder / "b.rrd")).stream():
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            values[chunk.entity_path, name] = batch.column(name).to_pylist()
    given = replayed_log(Simulated(file=log, threads=1), hypothesis)
    return values, given.log.trial.trajectory, given.simulated().simulated


def test_both_bodies_move_as_logged_and_as_simulated(shown: Shown, quadruped: Robot):
    values, logged, simulated = shown
    model, data = quadruped.model, mujoco.MjData(quadruped.model)
    for name, trajectory in ((LOGGED, logged), (SIMULATED, simulated)):
        shin = np.array(values[f"/world/{name}/front_left_lower", "Transform3D:translation"])
        turn = np.array(values[f"/world/{name}/front_left_lower", "Transform3D:quaternion"])
        for step in (0, STEPS - 1):
            data.qpos[:3] = trajectory["base_position"][step]
            data.qpos[3:7] = trajectory["base_orientation"][step]
            angles = trajectory["joint_positions"][step]
            for hinge, angle in zip(trajectory.names.hinges, angles, strict=True):
                data.joint(hinge).qpos[:] = angle
            mujoco.mj_kinematics(model, data)
            body = data.body("front_left_lower")

            assert np.allclose(shin[step, 0], body.xpos, atol=1e-6)
            assert np.allclose(turn[step, 0], np.roll(body.xquat, -1), atol=1e-6)


def test_the_plotted_joints_are_those_of_the_log_to_the_bit(shown: Shown):
    values, logged, simulated = shown
    for name, trajectory in ((LOGGED, logged), (SIMULATED, simulated)):
        for column, hinge in enumerate(trajectory.names.hinges):
            line = np.array(values[f"/joints/{hinge}/{name}", "Scalars:scalars"])[:, 0]

            assert np.array_equal(line, trajectory["joint_positions"][:, column])
    times = values["/joints/front_left_knee/logged", "trial time"]
    assert [round(time.total_seconds(), 6) for time in times] == pytest.approx(logged.time)


def test_a_jammed_part_is_red_in_both_bodies(shown: Shown):
    colours = {
        entity.split("/")[3]: column[0][0]
        for (entity, name), column in shown[0].items()
        if name.endswith(":colors") and entity.startswith("/world/simulated")
    }

    assert colours["back_left_lower"] == 0xC82828FF
    assert colours["torso"] == 0xE67814FF


def test_the_output_names_the_file_and_how_to_open_the_log_in_foxglove(folder: Path):
    told = succeeds("view", "a.mcap", "-o", "a.rrd", cwd=folder)

    assert "a.rrd: quadruped as logged, and simulated as intact, transparent" in told.stdout
    assert "In Foxglove or Lichtblick: open the local file a.mcap" in told.stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("-o", "a.mp4"), "--out needs a name that ends in .rrd"),
        (("-o", "missing/a.rrd"), "there is no folder missing"),
        (("-o", "taken.rrd"), "taken.rrd exists, and is not overwritten"),
        (("-o", "c.rrd", "--hypothesis", "break:nose"), "'nose'"),
    ],
)
def test_a_wrong_request_is_an_error_before_any_work(
    folder: Path, arguments: tuple[str, ...], message: str
):
    (folder / "taken.rrd").touch()
    refused("view", "a.mcap", *arguments, said=message, cwd=folder)
    assert (folder / "taken.rrd").read_bytes() == b""


MODEL = mujoco.MjModel.from_xml_string("""
<mujoco>
  <asset>
    <mesh name="wedge" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/>
    <hfield name="hills" nrow="2" ncol="2" size="1 1 1 1"/>
  </asset>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <geom type="hfield" hfield="hills"/>
    <body>
      <geom type="capsule" fromto="0 0 1  0 1 1" size="0.1"/>
      <geom type="cylinder" fromto="0 0 1  0 1 1" size="0.1"/>
      <geom type="sphere" pos="1 2 3" size="0.2"/>
      <geom type="ellipsoid" size="0.1 0.2 0.3"/>
      <geom type="box" pos="1 0 0" size="0.1 0.2 0.3" euler="0 0 90"/>
      <geom type="mesh" mesh="wedge" pos="5 0 0"/>
    </body>
  </worldbody>
</mujoco>
""")
SHAPES = {shape.kind: shape for shape in shapes_of(MODEL, np.arange(MODEL.ngeom))}


def parts(kind: str, *, transparent: bool = False) -> dict[str, list]:
    """The components of a shape, by name."""
    drawn = archetype(MODEL, SHAPES[kind], (1, 2, 3, 255), transparent=transparent)
    return {
        batch.component_descriptor().component.partition(":")[2]: batch.as_arrow_array().to_pylist()
        for batch in drawn.as_component_batches()
    }


def turned(found: dict[str, list], vector: list[float]) -> np.ndarray:
    """A vector in the frame of a shape, turned into the frame of its body."""
    out = np.empty(3)
    quaternion = np.roll(np.array(found["quaternions"][0], dtype=float), 1)
    mujoco.mju_rotVecQuat(out, np.array(vector), quaternion)
    return out


def test_the_ground_is_no_shape_and_every_other_geom_is_one():
    assert sorted(SHAPES) == ["box", "capsule", "cylinder", "ellipsoid", "mesh", "sphere"]
    assert len(SHAPES) == MODEL.ngeom - 2


def test_a_capsule_reaches_from_one_end_to_the_other_and_a_cylinder_is_around_its_middle():
    capsule, cylinder = parts("capsule"), parts("cylinder")
    start = np.array(capsule["translations"][0])
    end = start + turned(capsule, [0, 0, capsule["lengths"][0]])

    assert sorted([start.round(6).tolist(), end.round(6).tolist()]) == [[0, 0, 1], [0, 1, 1]]
    assert capsule["radii"] == pytest.approx([0.1])
    assert cylinder["centers"][0] == pytest.approx([0, 0.5, 1])
    axis = np.abs(turned(cylinder, [0, 0, cylinder["lengths"][0]]))
    assert axis == pytest.approx([0, 1, 0], abs=1e-6)


def test_other_shapes_have_their_sizes_and_places():
    assert parts("sphere")["half_sizes"][0] == pytest.approx([0.2, 0.2, 0.2])
    assert parts("sphere")["centers"][0] == pytest.approx([1, 2, 3])
    assert parts("ellipsoid")["half_sizes"][0] == pytest.approx([0.1, 0.2, 0.3])
    box = parts("box")
    assert box["centers"][0] == pytest.approx([1, 0, 0])
    assert np.abs(turned(box, box["half_sizes"][0])) == pytest.approx([0.2, 0.1, 0.3], abs=1e-6)
    assert parts("box", transparent=True)["fill_mode"] != box["fill_mode"]
    vertices = np.array(parts("mesh")["vertex_positions"])
    assert sorted(vertices.round(5).tolist()) == [[5, 0, 0], [5, 0, 1], [5, 1, 0], [6, 0, 0]]


def opened(monkeypatch: pytest.MonkeyPatch, port: int, end: str = "") -> list[str]:
    """What is done to show a trial in a viewer, which may end early."""
    done: list[str] = []

    def flush(timeout_sec: float) -> None:
        assert 0 < timeout_sec < 1000
        if end:
            raise RuntimeError(end)
        done.append("flush")

    stream = SimpleNamespace(connect_grpc=done.append, flush=flush)
    module: Any = SimpleNamespace(RecordingStream=lambda _name: stream)
    monkeypatch.setattr(view, "import_rerun", lambda: module)
    monkeypatch.setattr(view, "fill_recording", lambda *_: done.append("fill"))
    monkeypatch.setenv("DISPLAY", ":0")
    nothing: Any = None
    open_viewer(nothing, nothing, port)
    return [step.replace(str(port), "PORT") for step in done]


def free_port() -> int:
    with socket.create_server((HOST, 0)) as server:
        return server.getsockname()[1]


def test_a_viewer_that_runs_shows_the_recording_too(monkeypatch: pytest.MonkeyPatch):
    with socket.create_server((HOST, 0)) as viewer:
        done = opened(monkeypatch, viewer.getsockname()[1])

    assert done == ["rerun+http://127.0.0.1:PORT/proxy", "fill", "flush"]


def test_a_viewer_that_ends_early_or_another_program_is_an_error_with_the_remedies(
    monkeypatch: pytest.MonkeyPatch,
):
    with (
        socket.create_server((HOST, 0)) as viewer,
        pytest.raises(WorkError, match=r"severed; .* --port N, .* -o NAME\.rrd"),
    ):
        opened(monkeypatch, viewer.getsockname()[1], end="severed")


def test_a_viewer_that_does_not_start_is_an_error_and_keeps_no_output_open(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    told = tmp_path / "told"
    devices = "str([os.fstat(number).st_rdev for number in (1, 2)])"
    look = f"import os; open({str(told)!r}, 'w').write({devices}); raise SystemExit(3)"
    monkeypatch.setattr(view, "viewer_command", lambda _port: [sys.executable, "-Sc", look])

    with pytest.raises(WorkError, match=r"did not start: .* 3; write a file"):
        opened(monkeypatch, free_port())

    assert told.read_text() == str([Path(os.devnull).stat().st_rdev] * 2)


@pytest.mark.process
@pytest.mark.filterwarnings("ignore:subprocess .* is still running:ResourceWarning")  # it goes on
@pytest.mark.skipif(sys.platform != "linux", reason="processes are found in /proc")
def test_a_viewer_listens_on_this_computer_alone(monkeypatch: pytest.MonkeyPatch):
    port = free_port()
    # The same command without a window.
    command = [*view.viewer_command(port), "--serve-grpc"]
    monkeypatch.setattr(view, "viewer_command", lambda _port: command)
    try:
        opened(monkeypatch, port)
        reached = [is_listening(port, host) for host in (HOST, "127.0.0.2")]
    finally:
        end(command[4:])

    assert reached == [True, False]


def end(arguments: list[str]) -> None:
    """Ends the processes with these arguments: the viewer, and the command that started it."""
    last = "\0".join(arguments).encode() + b"\0"
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):
            if path.read_bytes().endswith(last):
                os.kill(int(path.parent.name), signal.SIGKILL)


@pytest.mark.skipif(sys.platform != "linux", reason="other systems always have a display")
def test_without_a_display_the_error_names_the_file_to_write():
    with pytest.raises(InputError, match=r"-o NAME\.rrd"):
        view.check_display({})
    view.check_display({"WAYLAND_DISPLAY": "wayland-0"})


def test_a_missing_package_is_named_with_its_extra(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "rerun", None)

    with pytest.raises(InputError, match=r"selfmodel\[rerun\]"):
        view.import_rerun()
