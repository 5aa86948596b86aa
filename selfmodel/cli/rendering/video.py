"""Encoding of frames: GIF by Pillow, MP4 by the program ffmpeg."""

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
"""Frames per second of real time; the unit of a GIF is a hundredth of a second."""

MAX_FRAMES = 50_000
"""Largest number of frames of a film, over half an hour: a GIF of these has some 500 MB."""

Frames = Iterator[NDArray[np.uint8]]


def gif(frames: Frames) -> bytes:
    """Returns a GIF that repeats for ever."""
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
    """Returns a frame with its own palette of 128 colours, undithered for small files."""
    return Image.fromarray(frame).quantize(
        128, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE
    )


def mp4(frames: Frames) -> bytes:
    """Returns an MP4 in ffmpeg's default encoding, H.264 in most builds.

    Raises:
        WorkError: ffmpeg is missing, or it failed.
    """
    program = ffmpeg()
    first = next(frames)
    height, width, _ = first.shape
    with tempfile.TemporaryDirectory() as folder:
        path, messages = Path(folder) / "film.mp4", Path(folder) / "messages"
        command = [program, "-nostdin", "-loglevel", "error"]
        command += ["-f", "rawvideo", "-pixel_format", "rgb24", "-video_size", f"{width}x{height}"]
        command += ["-framerate", str(RATE), "-i", "pipe:0"]
        # yuv420p: every player supports it; faststart: the index comes first.
        command += ["-pix_fmt", "yuv420p", "-movflags", "+faststart", str(path)]
        with (
            messages.open("wb") as errors,
            subprocess.Popen(  # noqa: S603  # a program from the path, and names from above
                command, stdin=subprocess.PIPE, stdout=errors, stderr=errors
            ) as encoder,
        ):
            _feed(encoder, first, frames)
        if encoder.returncode != 0 or not path.exists():
            text = " ".join(messages.read_text(errors="replace").split())
            raise WorkError(f"ffmpeg could not make the film: {text or 'it printed nothing'}")
        return path.read_bytes()


def _feed(encoder: subprocess.Popen[bytes], first: NDArray[np.uint8], frames: Frames) -> None:
    if encoder.stdin is None:
        raise WorkError("ffmpeg does not read frames")
    with ExitStack() as unfinished:
        unfinished.callback(encoder.kill)
        # If ffmpeg has exited, its status and its messages contain the reason.
        with suppress(BrokenPipeError):
            encoder.stdin.write(first.tobytes())
            for frame in frames:
                encoder.stdin.write(frame.tobytes())
            encoder.stdin.close()
        unfinished.pop_all()


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
