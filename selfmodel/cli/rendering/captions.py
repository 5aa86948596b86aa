"""What stands in a frame beside the robot: whose motion it is, when, and how far it has come."""

import textwrap

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from selfmodel.cli.rendering.film import Film, Shot

SIZE = 16
"""Height of the letters, pixels."""

LETTERS = 54
"""How many fit into a line."""

INK, ALARM, PAPER = (20, 24, 30), (190, 20, 20), (255, 255, 255, 150)


def captioned(picture: NDArray[np.uint8], film: Film, shot: Shot, frame: int) -> NDArray[np.uint8]:
    """Returns the picture of one motion with its captions."""
    image = Image.fromarray(picture)
    draw = ImageDraw.Draw(image, "RGBA")
    font = ImageFont.load_default(SIZE)
    title = "\n".join(textwrap.wrap(shot.title, LETTERS))
    _write(draw, (8, 6), title, font, INK)
    _write(draw, (8, image.height - SIZE - 10), told(film, shot, frame), font, INK)
    if shot.held[frame]:
        _write(draw, (8, image.height - 2 * SIZE - 18), "not observed: as last seen", font, ALARM)
    return np.asarray(image)


def told(film: Film, shot: Shot, frame: int) -> str:
    """Returns when it is, and how far the base has come."""
    forward = shot.forward[frame]
    way = (
        f"{round(forward, 2) + 0.0:.2f} m forward" if np.isfinite(forward) else "base not observed"
    )
    return f"{film.time[frame]:.2f} s   {way}"


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
