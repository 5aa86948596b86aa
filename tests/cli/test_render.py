"""``selfmodel render``: pictures of a trial from its log, on any machine."""

import dataclasses
import json
import re
import subprocess
import sys
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from selfmodel import opengl
from selfmodel.cli import render
from selfmodel.cli.film import Film, film_of, painted
from selfmodel.cli.sticks import draw_ground, stick_frames, strip
from selfmodel.errors import InputError, WorkError
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.logs.records import TrialHeader
from selfmodel.logs.results import best_hypothesis
from selfmodel.logs.writer import write_trial
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.motion import POSE
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import TrialPlan
from tests.helpers.command import selfmodel_process
from tests.helpers.drivers import random_controllers

STEPS = 31
"""0.3 s, which are 8 frames of a film."""

DAMAGE = "break:front_left_knee"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, quadruped: Robot) -> Path:
    """A folder with a short log of a damaged quadruped."""
    folder = tmp_path_factory.mktemp("render")
    (controller,) = random_controllers(quadruped, 1, seed=3)
    plan = TrialPlan("trial", "single", controller, STEPS, 0)
    without = re.sub(r"<light [^>]*/>", "", quadruped.mjcf)
    off = '<visual><headlight active="0"/></visual><worldbody>'
    dark = dataclasses.replace(quadruped, mjcf=without.replace("<worldbody>", off, 1))
    for name, robot in (("a.mcap", quadruped), ("dark.mcap", dark)):
        samples = SimulatedRobot(robot, parse(DAMAGE, robot.anatomy)).run(controller, STEPS)
        write_trial(folder / name, robot, plan, samples, TrialHeader(Settings()))
    return folder


def film(robot: Robot, text: str, frames: int = 2, unseen: slice = slice(0)) -> Film:
    """A film of a random motion with some steps of it not observed."""
    (controller,) = random_controllers(robot, 1)
    batch = Simulator(robot, 1).run([(INTACT, controller)], STEPS, POSE).trajectory
    signals = {signal: batch[signal][0].copy() for signal in POSE}
    signals["joint_positions"][unseen] = np.nan
    seen = Trajectory(batch.names, batch.time, signals)
    moments = np.linspace(0, batch.time[-1], frames)
    hypothesis = parse(text, robot.anatomy)
    return film_of(robot, hypothesis, [("logged: $x_1", seen), ("model", seen)], moments)


@pytest.mark.process
def test_the_best_of_a_diagnosis_is_drawn_as_a_strip_whatever_there_is_of_opengl(
    folder: Path, tmp_path: Path
):
    """Even where the library that MuJoCo is told to take would end any program."""
    out, result = tmp_path / "strip.png", tmp_path / "result.json"
    result.write_text(json.dumps({"diagnosis": [{"hypothesis": DAMAGE}, {"hypothesis": "intact"}]}))
    arguments = ("render", "a.mcap", "-o", str(out), "--diagnosis", str(result), "--pictures", "3")
    done = selfmodel_process(*arguments, "--json", cwd=folder, MUJOCO_GL="nothing-like-it")
    told = json.loads(done.stdout)

    assert (done.returncode, done.stderr) == (0, "")
    with Image.open(out) as image:
        assert image.format == "PNG"
    assert (told["out"], told["hypothesis"], told["frames"]) == (str(out), DAMAGE, 3)
    assert (told["drawn_by"], told["gl"], told["held"]) == ("matplotlib", None, 0)
    assert told["bytes"] == out.stat().st_size
    assert {p.name for p in tmp_path.iterdir()} == {"strip.png", "result.json"}


@pytest.mark.process
@pytest.mark.opengl
@pytest.mark.parametrize("log", ["a.mcap", "dark.mcap"])
def test_a_film_is_drawn_by_mujoco_with_what_works_of_itself_and_has_light(
    log: str, folder: Path, gl: str, tmp_path: Path
):
    out = tmp_path / "film.gif"
    done = selfmodel_process("render", log, "-o", str(out), "--json", cwd=folder, MUJOCO_GL="")
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["gl"] == gl
    with Image.open(out) as image:
        assert (image.n_frames, image.info["duration"]) == (8, 40)
        frame = np.asarray(image.convert("RGB")).astype(int)

    assert frame.shape == (360, 960, 3)
    assert np.ptp(frame) > 150  # there is something to be seen
    assert frame[:300].mean() > 60  # beside the captions


@pytest.mark.parametrize("works", [("osmesa",), ()])
def test_egl_is_tried_before_osmesa_and_where_neither_is_packages_are_named(
    works: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("MUJOCO_GL", "")
    monkeypatch.setattr(opengl, "draws", lambda name: name in works)
    monkeypatch.setattr(opengl, "WITHOUT_SCREEN", ("egl", "osmesa"))
    if works:
        assert opengl.choose_gl(render.INSTEAD) == works[0]
    else:
        with pytest.raises(WorkError, match=r"neither EGL nor OSMesa.*libosmesa6.*-o NAME\.png"):
            opengl.choose_gl(render.INSTEAD)


def test_a_library_that_needs_a_screen_is_refused_without_one(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("MUJOCO_GL", "glfw")
    for screen in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(screen, raising=False)
    monkeypatch.setattr(opengl, "draws", lambda _: False)
    with pytest.raises(WorkError, match=r"MUJOCO_GL=glfw: unset it, .* leave render_mode out"):
        opengl.prepare_dm_control.__wrapped__()


@pytest.mark.parametrize(
    ("text", "best"),
    [
        ('[{"ranked": [{"hypothesis": "a"}]}, {"ranked": [{"hypothesis": "b"}]}]', "b"),
        ('{"diagnosis": [{"hypothesis": "c", "distance": null}]}', "c"),
        *((text, None) for text in ("", "[]", "{}", "3", "null", '{"diagnosis": []}', "\xff")),
        *((text, None) for text in ('[{"ranked": 1}]', '{"diagnosis": [{"hypothesis": 1}]}')),
        ("[" * 100_000, None),
    ],
)
def test_a_diagnosis_is_read_or_refused(text: str, best: str | None, tmp_path: Path):
    path = tmp_path / "diagnosis.json"
    path.write_bytes(text.encode("latin-1"))
    if best is not None:
        assert best_hypothesis(path) == best
        return
    with pytest.raises(InputError, match=r"diagnosis\.json: expected a diagnosis"):
        best_hypothesis(path)


def test_what_is_lost_is_pale_and_what_is_jammed_red_in_a_film(robot: Robot):
    broken, jammed = robot.anatomy.joints[0], robot.anatomy.joints[-2]
    drawn = film(robot, f"break:{broken.name}+jam:{jammed.name}")
    before = drawn.model.geom_rgba.copy()
    model = painted(drawn)
    names = [model.body(body).name for body in model.geom_bodyid]
    lost = np.isin(names, list(broken.bodies))
    held = np.isin(model.geom_bodyid, list(drawn.jammed))
    feet = np.isin([model.body(body).name for body in model.site_bodyid], list(broken.bodies))

    assert lost.sum() == len(broken.bodies)
    assert held.sum() == feet.sum() == 1
    assert np.all(model.geom_rgba[lost, 3] < 0.5)
    assert np.all(model.site_rgba[feet, 3] < 0.5)
    assert np.all(model.geom_rgba[~lost, 3] == 1)
    assert np.all(model.geom_rgba[held, 0] > 3 * model.geom_rgba[held, 1])
    assert np.all(model.geom_matid[lost | held] == -1)
    assert np.all(model.geom_matid[~lost & ~held] >= 0)
    np.testing.assert_array_equal(drawn.model.geom_rgba, before)


def test_the_camera_is_on_the_side_of_what_is_damaged(quadruped: Robot):
    left, right = (film(quadruped, f"break:front_{side}_shoulder") for side in ("left", "right"))

    assert left.azimuth == -right.azimuth
    assert right.azimuth > 0, "from the robot's right, it looks to the left, along y"
    assert film(quadruped, "intact").azimuth == right.azimuth


@pytest.mark.parametrize("kind", ["png", "pdf"])
def test_steps_that_were_not_observed_are_marked_in_every_kind_of_strip(
    quadruped: Robot, kind: str
):
    drawn = film(quadruped, DAMAGE, frames=3, unseen=slice(10, 20))
    begins = {"png": b"\x89PNG", "pdf": b"%PDF"}[kind]

    found = strip(drawn, kind)

    assert drawn.shots[0].held.tolist() == [False, True, False]
    assert found.startswith(begins)
    assert found != strip(film(quadruped, DAMAGE, frames=3), kind)


def test_each_frame_shows_the_pose_of_its_moment(quadruped: Robot):
    drawn = film(quadruped, "intact", frames=3)
    logged, simulated = drawn.shots
    bent = simulated.qpos.copy()
    bent[2, -1] += 0.5
    other = replace(drawn, shots=(logged, replace(simulated, qpos=bent)))
    frames, others = (np.array(list(stick_frames(each))) for each in (drawn, other))

    np.testing.assert_array_equal(frames[:2], others[:2])
    np.testing.assert_array_equal(frames[2, :, :480], others[2, :, :480])
    assert np.any(frames[2, :, 480:] != others[2, :, 480:])


def test_a_gif_and_an_mp4_have_every_frame(quadruped: Robot, tmp_path: Path):
    frames = list(stick_frames(film(quadruped, "intact", frames=3)))
    with Image.open(BytesIO(render.gif(iter(frames)))) as image:
        assert (image.n_frames, image.size, image.info["loop"]) == (3, (960, 360), 0)
    path = tmp_path / "film.mp4"
    path.write_bytes(render.mp4(iter(frames)))
    command = [render.ffmpeg(), "-loglevel", "error", "-i", str(path)]
    command += ["-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    decoded = subprocess.run(command, capture_output=True, check=True).stdout
    shown = np.frombuffer(decoded, dtype=np.uint8).reshape(-1, *frames[0].shape)

    assert len(shown) == 3
    assert np.abs(shown.astype(int) - np.array(frames)).mean() < 3


def test_an_mp4_without_ffmpeg_is_refused_with_what_to_install(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(render.shutil, "which", lambda _: None)
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(WorkError, match=r"ffmpeg.*selfmodel\[render\].*\.gif"):
        render.ffmpeg()


def test_a_failing_ffmpeg_says_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    program = tmp_path / "ffmpeg"
    program.write_text("#!/bin/sh\necho no such encoder >&2\nexit 3\n")
    program.chmod(0o755)
    monkeypatch.setattr(render, "ffmpeg", lambda: str(program))
    frames = iter([np.zeros((360, 960, 3), dtype=np.uint8)] * 3)
    with pytest.raises(WorkError, match="could not make the film: no such encoder"):
        render.mp4(frames)


def test_a_film_takes_as_long_as_the_trial_however_long_a_control_step_is(quadruped: Robot):
    drawn = film(replace(quadruped, control_timestep=0.1), "intact", frames=76)  # of 3 s

    np.testing.assert_allclose(drawn.time, np.floor(np.arange(76) / 2.5 + 1e-9) * 0.1)


def test_the_ground_of_a_stick_figure_slopes_as_the_world_does(quadruped: Robot):
    normal = film(quadruped, "slope=0.2").normal

    np.testing.assert_allclose(normal, [-np.sin(0.2), 0, np.cos(0.2)])
    axes = Figure().subplots()
    side = np.array([[1.0, 0], [0, 0], [0, 1.0]])  # x to the right, z up
    draw_ground(axes, normal, np.zeros(3), side, 1.0)
    (lines,) = axes.collections
    for line in lines.get_segments():
        np.testing.assert_allclose(line[:, 1], np.tan(0.2) * line[:, 0], atol=1e-12)
