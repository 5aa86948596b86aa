"""Frames as a film in a file: GIF by Pillow, MP4 by the program ffmpeg."""

import importlib
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from selfmodel.errors import WorkError

RATE = 25
"""Frames a second, in real time; a GIF counts in hundredths of a second."""

Frames = Iterator[NDArray[np.uint8]]


def gif(frames: Frames) -> bytes:
    """Returns a GIF that begins again at its end."""
    pictures = (_indexed(frame) for frame in frames)
    file = BytesIO()
    next(pictures).save(
        file,
        format="GIF",
        save_all=True,
        append_images=pictures,
        duration=1000 // RATE,
        loop=0,
    )
    return file.getvalue()


def _indexed(frame: NDArray[np.uint8]) -> Image.Image:
    """A frame in 128 colours of its own, without the dither that makes files large."""
    return Image.fromarray(frame).quantize(
        128, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE
    )


def mp4(frames: Frames) -> bytes:
    """Returns an MP4 in the best encoding that ffmpeg has for it, which is H.264 nearly always.

    Raises:
        WorkError: There is no ffmpeg, or it failed.
    """
    program = ffmpeg()
    first = next(frames)
    height, width, _ = first.shape
    with tempfile.TemporaryDirectory() as folder:
        path, said = Path(folder) / "film.mp4", Path(folder) / "said"
        command = [program, "-nostdin", "-loglevel", "error"]
        command += ["-f", "rawvideo", "-pixel_format", "rgb24", "-video_size", f"{width}x{height}"]
        command += ["-framerate", str(RATE), "-i", "pipe:0"]
        # What every player can show; and what it needs first stands first.
        command += ["-pix_fmt", "yuv420p", "-movflags", "+faststart", str(path)]
        with (
            said.open("wb") as errors,
            subprocess.Popen(  # noqa: S603  # a program that was found, and names from above
                command, stdin=subprocess.PIPE, stdout=errors, stderr=errors
            ) as encoder,
        ):
            _feed(encoder, first, frames)
        if encoder.returncode != 0 or not path.exists():
            told = " ".join(said.read_text(errors="replace").split())
            raise WorkError(f"ffmpeg could not make the film: {told or 'it said nothing'}")
        return path.read_bytes()


def _feed(encoder: subprocess.Popen[bytes], first: NDArray[np.uint8], frames: Frames) -> None:
    if encoder.stdin is None:
        raise WorkError("ffmpeg takes no frames")
    with ExitStack() as unfinished:
        unfinished.callback(encoder.kill)
        # Where it has ended before, its status and its words say why.
        with suppress(BrokenPipeError):
            encoder.stdin.write(first.tobytes())
            for frame in frames:
                encoder.stdin.write(frame.tobytes())
            encoder.stdin.close()
        unfinished.pop_all()


def ffmpeg() -> str:
    """Returns the program: the one on the path, or the one that imageio-ffmpeg brings.

    Raises:
        WorkError: There is neither.
    """
    found = shutil.which("ffmpeg")
    if found:
        return found
    try:
        return str(importlib.import_module("imageio_ffmpeg").get_ffmpeg_exe())
    except (ImportError, RuntimeError):  # not there, or there without the program
        raise WorkError(
            "an .mp4 needs the program ffmpeg, and there is none: install it (apt-get install "
            "ffmpeg, or pip install 'selfmodel[render]'), or write a .gif"
        ) from None
