"""``selfmodel render``: a trial as a film or a strip of pictures, from its log."""

import importlib
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from io import BytesIO
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from rich.progress import track

from selfmodel.cli.commands import Render
from selfmodel.cli.inputs import check_new_file
from selfmodel.cli.output import counted, plain, print_json, print_lines, print_notes
from selfmodel.cli.tables import text_console
from selfmodel.errors import InputError, WorkError
from selfmodel.logs.files import replace_file
from selfmodel.logs.results import best_hypothesis

if TYPE_CHECKING:
    from selfmodel.cli.film import Film
    from selfmodel.cli.replay import ReplayedLog

STRIPS = (".png", ".svg", ".pdf")
"""File extensions of a strip of pictures."""

FILMS = (".gif", ".mp4")
"""File extensions of a film."""

RATE = 25
"""Frames per second of real time; the unit of a GIF is a hundredth of a second."""

MAX_FRAMES = 50_000
"""Largest number of frames of a film, over half an hour: a GIF of these has some 500 MB."""

GL = "MUJOCO_GL"
"""Environment variable with the OpenGL library, which MuJoCo reads as it is imported."""

WITHOUT_SCREEN = ("egl", "osmesa") if sys.platform == "linux" else ("",)
"""Values that are tried, in this order; other systems than Linux use MuJoCo's default."""

PICTURE = (
    "import mujoco\n"
    "model = mujoco.MjModel.from_xml_string('<mujoco><worldbody><light/></worldbody></mujoco>')\n"
    "with mujoco.Renderer(model, 8, 8) as renderer:\n"
    "    renderer.update_scene(mujoco.MjData(model))\n"
    "    renderer.render()\n"
)
"""Program that draws one picture."""

PICTURE_SECONDS = 60
"""Time limit of that program."""

Frames = Iterator[NDArray[np.uint8]]


def render(options: Render) -> None:
    """Draw a logged trial beside a simulation of the same controller."""
    if not options.file.name:
        raise InputError(f"expected a trial log, NAME.mcap, got the folder {options.file}")
    out = options.out or options.file.with_suffix(".gif")
    kind = out.suffix.lower()
    check_new_file(out, *FILMS, *STRIPS)
    if options.stick and kind in STRIPS:
        raise InputError(f"--stick is for films: a strip such as {out.name} has stick figures")
    if options.hypothesis and options.diagnosis is not None:
        raise InputError("expected --hypothesis or --diagnosis, got both: leave one out")
    if kind == ".mp4":
        ffmpeg()  # a missing program is an error before any work is done
    library = None if options.stick or kind in STRIPS else choose_gl()
    if library is None:
        os.environ[GL] = "disable"
    # MuJoCo reads MUJOCO_GL as it is imported, so the library is chosen before.
    from selfmodel.cli.film import filmed  # noqa: PLC0415
    from selfmodel.cli.replay import replayed_log  # noqa: PLC0415

    notation = options.hypothesis or "intact"
    if options.diagnosis is not None:
        notation = best_hypothesis(options.diagnosis)
    given = replayed_log(options, notation)
    film, facts = _film(given, options.pictures if kind in STRIPS else None)
    print_notes(*(f"note: {note}" for note in facts["notes"]))
    if library is None:
        from selfmodel.cli.sticks import stick_frames, strip  # noqa: PLC0415  # matplotlib

        frames = stick_frames(film)
    else:
        frames = filmed(film)
    if kind in STRIPS:
        data = strip(film, kind[1:])
    else:
        data = (gif if kind == ".gif" else mp4)(_shown(frames, len(film.time)))
    replace_file(out, data)
    drawn_by = "matplotlib" if library is None else "mujoco"
    if options.as_json:
        facts |= {"out": str(out), "frames": len(film.time), "bytes": len(data)}
        facts |= {"drawn_by": drawn_by, "gl": library}
        logged = {"log": str(options.file), "robot": given.robot.name, "model": options.self_model}
        print_json(logged | facts)
        return
    print_lines(
        f"{out}: {counted(len(film.time), 'picture')} of {given.robot.name}, as logged and as "
        f"{given.hypothesis}, drawn by {drawn_by}" + (f" ({library})" if library else "")
    )


def _film(given: "ReplayedLog", pictures: int | None) -> tuple["Film", dict[str, Any]]:
    """Returns the film of a trial and its simulation, and facts about it as JSON values.

    Args:
        given: The log, and what to simulate.
        pictures: Pictures of a strip; None for a film.
    """
    from selfmodel.cli.film import evenly, film_of  # noqa: PLC0415  # as above

    trial, time = given.log.trial, given.log.trial.trajectory.time
    if pictures is None and not time[-1] * RATE < MAX_FRAMES:
        raise InputError(
            f"{trial.path}: the trial takes {time[-1]:g} s, and a film takes at most "
            f"{MAX_FRAMES / RATE:g} s: write a strip of pictures, such as trial.png"
        )
    found = given.drawable()
    motions = [
        (plain(f"logged: {trial.plan.name}"), trial.trajectory),
        (plain(f"model: {given.hypothesis}"), found.simulated),
    ]
    whole = np.arange(int(float(time[-1]) * RATE) + 1) / RATE
    moments = whole if pictures is None else evenly(time, pictures)
    film = film_of(given.robot, given.hypothesis, motions, moments)
    held = int(film.shots[0].held.sum())
    notes = []
    if film.missing:
        notes.append(f"{trial.path} has no {', '.join(film.missing)}: drawn as in the initial pose")
    if held:
        count = counted(len(film.time), "picture")
        notes.append(f"{held} of {count} lack an observation: the last one is drawn, and marked")
    if found.diverged:
        notes.append("the simulation diverged: with this hypothesis the model is unstable")
    return film, {
        "hypothesis": str(given.hypothesis),
        "steps": trial.trajectory.steps,
        "missing": list(film.missing),
        "held": held,
        "diverged": found.diverged,
        "notes": notes,
    }


def _shown(frames: Frames, total: int) -> Frames:
    """Yields the frames; shows a progress bar on a terminal."""
    console = text_console(stderr=True)
    hidden = not console.is_terminal
    yield from track(frames, "drawing", total, console=console, disable=hidden, transient=True)


def choose_gl() -> str:
    """Sets ``MUJOCO_GL`` to a library that works; call it before MuJoCo is imported.

    If ``MUJOCO_GL`` is set, only that library is tried. Each is tried in a process of its own,
    because a failed initialisation cannot always be undone.

    Returns:
        The value of ``MUJOCO_GL``.

    Raises:
        WorkError: No library works.
    """
    wanted = os.environ.get(GL, "")
    found = next(filter(draws, (wanted,) if wanted else WITHOUT_SCREEN), None)
    if found is not None:
        os.environ[GL] = found
        return found
    if wanted:
        raise WorkError(
            f"MuJoCo cannot draw with {GL}={wanted}: unset it, so that EGL and OSMesa are tried, "
            f"or draw stick figures, with --stick or -o NAME.png"
        )
    raise WorkError(
        "MuJoCo found no library to draw with, neither EGL nor OSMesa: install one (on Debian and "
        "Ubuntu: apt-get install libegl1 libgl1-mesa-dri, or libosmesa6), or draw stick figures, "
        "with --stick or -o NAME.png"
    )


def draws(library: str) -> bool:
    """Returns whether MuJoCo renders a picture with that value of ``MUJOCO_GL``."""
    try:
        done = subprocess.run(  # noqa: S603  # this Python, and a text from above
            [sys.executable, "-c", PICTURE],
            env={**os.environ, GL: library},
            capture_output=True,
            check=False,
            timeout=PICTURE_SECONDS,
        )
    except subprocess.TimeoutExpired:
        return False
    return done.returncode == 0


def gif(frames: Frames) -> bytes:
    """Returns a GIF that repeats for ever."""
    pictures = (_indexed(frame) for frame in frames)
    file, first, more = BytesIO(), next(pictures), {"duration": 1000 // RATE, "loop": 0}
    first.save(file, format="GIF", save_all=True, append_images=pictures, **more)
    return file.getvalue()


def _indexed(frame: NDArray[np.uint8]) -> Image.Image:
    """Returns a frame with its own palette of 128 colours, undithered for small files."""
    return Image.fromarray(frame).quantize(
        128, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE
    )


def mp4(frames: Frames) -> bytes:
    """Returns an MP4 in ffmpeg's default encoding, H.264 in most builds.

    Raises:
        WorkError: ffmpeg is missing, or it failed.
    """
    first = next(frames)
    height, width, _ = first.shape
    command = [ffmpeg(), "-nostdin", "-loglevel", "error"]
    command += ["-f", "rawvideo", "-pixel_format", "rgb24", "-video_size", f"{width}x{height}"]
    command += ["-framerate", str(RATE), "-i", "pipe:0"]
    # yuv420p: every player supports it; faststart: the index comes first.
    command += ["-pix_fmt", "yuv420p", "-movflags", "+faststart"]
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryFile("w+b") as messages:
        path = Path(folder) / "film.mp4"
        with subprocess.Popen(  # noqa: S603  # a program from the path, and names from above
            [*command, str(path)], stdin=subprocess.PIPE, stdout=messages, stderr=messages
        ) as encoder:
            try:
                # If ffmpeg has exited, its status and its messages contain the reason.
                with suppress(BrokenPipeError):
                    for frame in chain([first], frames):
                        encoder.stdin.write(frame.tobytes())  # type: ignore[union-attr]  # a pipe
                    encoder.stdin.close()  # type: ignore[union-attr]
            except BaseException:  # Ctrl-C, too: no encoder is left running
                encoder.kill()
                raise
        if encoder.returncode != 0 or not path.exists():
            messages.seek(0)
            text = " ".join(messages.read().decode(errors="replace").split())
            raise WorkError(f"ffmpeg could not make the film: {text or 'it printed nothing'}")
        return path.read_bytes()


def ffmpeg() -> str:
    """Returns the path of ffmpeg: the system's, or else that of imageio-ffmpeg.

    Raises:
        WorkError: ffmpeg is not installed.
    """
    found = shutil.which("ffmpeg")
    if found:
        return found
    try:
        return str(importlib.import_module("imageio_ffmpeg").get_ffmpeg_exe())
    except (ImportError, RuntimeError):  # not installed, or installed without the program
        raise WorkError(
            "an .mp4 needs the program ffmpeg, which is not installed: install it (apt-get install "
            "ffmpeg, or pip install 'selfmodel[render]'), or write a .gif"
        ) from None
