"""``selfmodel render``: a trial as a film or a strip of pictures, from its log."""

import importlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from rich.progress import track

from selfmodel.cli.commands import Render
from selfmodel.cli.inputs import check_new_file
from selfmodel.cli.output import plain, print_json, print_lines, print_notes
from selfmodel.cli.tables import text_console
from selfmodel.errors import InputError, WorkError, counted
from selfmodel.logs.files import replace_file
from selfmodel.logs.results import best_hypothesis
from selfmodel.opengl import GL, choose_gl

STRIPS, FILMS = (".png", ".svg", ".pdf"), (".gif", ".mp4")
"""File extensions of a strip of pictures, and of a film."""

RATE = 25
"""Frames per second of real time; the unit of a GIF is a hundredth of a second."""

MAX_FRAMES = 50_000
"""Largest number of frames of a film, over half an hour: a GIF of these has some 500 MB."""

INSTEAD = "draw stick figures, with --stick or -o NAME.png"
"""What can be done without OpenGL."""

Frames = Iterator[NDArray[np.uint8]]


def render(options: Render) -> None:
    """Draw a logged trial beside a simulation of the same controller."""
    out = _out(options)
    kind = out.suffix.lower()
    library = None if options.stick or kind in STRIPS else choose_gl(INSTEAD)
    os.environ[GL] = "disable" if library is None else library
    # MuJoCo reads MUJOCO_GL as it is imported, so the library is chosen before.
    from selfmodel.cli.film import evenly, film_of, filmed  # noqa: PLC0415
    from selfmodel.cli.replay import replayed_log  # noqa: PLC0415
    from selfmodel.cli.sticks import stick_frames, strip  # noqa: PLC0415

    assumed = best_hypothesis(options.diagnosis) if options.diagnosis else options.hypothesis
    given = replayed_log(options, assumed or "intact")
    trial, time = given.log.trial, given.log.trial.trajectory.time
    if kind in FILMS and not time[-1] * RATE < MAX_FRAMES:
        raise InputError(
            f"{trial.path}: the trial takes {time[-1]:g} s, and a film takes at most "
            f"{MAX_FRAMES / RATE:g} s: write a strip of pictures, such as trial.png"
        )
    found = given.drawable()
    motions = [
        (plain(f"logged: {trial.plan.name}"), trial.trajectory),
        (plain(f"model: {given.hypothesis}"), found.simulated),
    ]
    moments = evenly(time, options.pictures)
    if kind in FILMS:
        moments = np.arange(int(float(time[-1]) * RATE) + 1) / RATE
    film = film_of(given.robot, given.hypothesis, motions, moments)
    held, pictures = int(film.shots[0].held.sum()), counted(len(film.time), "picture")
    sentences = {
        f"{trial.path} lacks {', '.join(film.missing)}: drawn as in the initial pose": film.missing,
        f"{held} of {pictures} lack an observation: the last one is drawn, and marked": held,
        "the simulation diverged: with this hypothesis the model is unstable": found.diverged,
    }
    notes = [sentence for sentence, holds in sentences.items() if holds]
    print_notes(*(f"note: {note}" for note in notes))
    if kind in STRIPS:
        data = strip(film, kind[1:])
    else:
        frames = stick_frames(film) if library is None else filmed(film)
        data = (gif if kind == ".gif" else mp4)(_shown(frames, len(film.time)))
    replace_file(out, data)
    drawn_by = "matplotlib" if library is None else "mujoco"
    if options.as_json:
        facts = {
            "log": str(options.file),
            "robot": given.robot.name,
            "model": options.self_model,
            "hypothesis": str(given.hypothesis),
            "steps": trial.trajectory.steps,
            "missing": list(film.missing),
            "held": held,
            "diverged": found.diverged,
            "notes": notes,
            "out": str(out),
            "frames": len(film.time),
            "bytes": len(data),
            "drawn_by": drawn_by,
            "gl": library,
        }
        print_json(facts)
        return
    print_lines(
        f"{out}: {pictures} of {given.robot.name}, as logged and as {given.hypothesis}, drawn by "
        f"{drawn_by}" + (f" ({library})" if library else "")
    )


def _out(options: Render) -> Path:
    if not options.file.name:
        raise InputError(f"expected a trial log, NAME.mcap, got the folder {options.file}")
    out = options.out or options.file.with_suffix(".gif")
    check_new_file(out, *FILMS, *STRIPS)
    if options.stick and out.suffix.lower() in STRIPS:
        raise InputError(f"--stick is for films: a strip such as {out.name} has stick figures")
    if options.hypothesis and options.diagnosis is not None:
        raise InputError("expected --hypothesis or --diagnosis, got both: leave one out")
    if out.suffix.lower() == ".mp4":
        ffmpeg()
    return out


def _shown(frames: Frames, total: int) -> Frames:
    console = text_console(stderr=True)
    hidden = not console.is_terminal
    yield from track(frames, "drawing", total, console=console, disable=hidden, transient=True)


def gif(frames: Frames) -> bytes:
    """Returns a GIF that repeats for ever; each frame has its own palette of 128 colours."""
    pictures = (
        Image.fromarray(frame).quantize(
            128, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE
        )
        for frame in frames
    )
    file, first, more = BytesIO(), next(pictures), {"duration": 1000 // RATE, "loop": 0}
    first.save(file, format="GIF", save_all=True, append_images=pictures, **more)
    return file.getvalue()


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
                with suppress(BrokenPipeError), encoder.stdin as pipe:  # type: ignore[union-attr]
                    pipe.write(first.tobytes())
                    for frame in frames:
                        pipe.write(frame.tobytes())
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
    if found := shutil.which("ffmpeg"):
        return found
    try:
        return str(importlib.import_module("imageio_ffmpeg").get_ffmpeg_exe())
    except (ImportError, RuntimeError):  # not installed, or installed without the program
        raise WorkError(
            "an .mp4 needs the program ffmpeg, which is not installed: install it (apt-get install "
            "ffmpeg, or pip install 'selfmodel[render]'), or write a .gif"
        ) from None
