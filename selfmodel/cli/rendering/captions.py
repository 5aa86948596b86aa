"""Captions of a frame: title of the motion, time, and forward displacement."""

import textwrap

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from selfmodel.cli.rendering.film import Film, Shot

SIZE = 16
"""Height of the font, pixels."""

LINE_LENGTH = 54
"""Most characters of a line."""

INK, ALARM, PAPER = (20, 24, 30), (190, 20, 20), (255, 255, 255, 150)


def captioned(picture: NDArray[np.uint8], film: Film, shot: Shot, frame: int) -> NDArray[np.uint8]:
    """Returns the picture of one motion with its captions."""
    image = Image.fromarray(picture)
    draw = ImageDraw.Draw(image, "RGBA")
    font = ImageFont.load_default(SIZE)
    title = "\n".join(textwrap.wrap(shot.title, LINE_LENGTH))
    _write(draw, (8, 6), title, font, INK)
    _write(draw, (8, image.height - SIZE - 10), caption(film, shot, frame), font, INK)
    if shot.held[frame]:
        _write(
            draw, (8, image.height - 2 * SIZE - 18), "not observed: last known pose", font, ALARM
        )
    return np.asarray(image)


def caption(film: Film, shot: Shot, frame: int) -> str:
    """Returns the time and the forward displacement of the base, as text."""
    forward = shot.forward[frame]
    displacement = (
        f"{round(forward, 2) + 0.0:.2f} m forward" if np.isfinite(forward) else "base not observed"
    )
    return f"{film.time[frame]:.2f} s   {displacement}"


def _write(
    draw: ImageDraw.ImageDraw,
    place: tuple[int, int],
    text: str,
    font: ImageFont.FreeTypeFont | ImageFont.ImageFont,
    colour: tuple[int, int, int],
) -> None:
    left, top, right, bottom = draw.multiline_textbbox(place, text, font=font)
    draw.rectangle((left - 4, top - 3, right + 4, bottom + 3), fill=PAPER)
    draw.multiline_text(place, text, font=font, fill=colour)
