"""Films and filmstrips of every model, and a contact sheet of them.

``python -m benchmarks.lab_robots.films WHEELS OUT`` runs one trial of each model with its evolved
gait of seed 0, or with a random CPG if it has none, draws the trial into ``OUT/films``, and writes
``docs/figures/lab-robots.png``. It needs OpenGL.
"""

import argparse
import subprocess
import sys
from pathlib import Path

from PIL import Image, ImageDraw

from benchmarks.lab_robots.models import write_models
from benchmarks.lab_robots.study import folder_of

FIGURE = Path("docs/figures/lab-robots.png")
COLUMNS, TILE = 4, (360, 232)
CAPTION = 26
"""Height of the captions of a film, pixels."""


def main() -> None:
    """Draws the films and the contact sheet."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("wheels", type=Path, help="folder of the unpacked wheels")
    parser.add_argument("out", type=Path, help="folder of the study")
    options = parser.parse_args()
    wheels, out = options.wheels, options.out
    folder = out / "films"
    folder.mkdir(parents=True, exist_ok=True)
    models = write_models(wheels, out / "models")
    for name, path in models.items():
        gait = folder_of(out, 0.0) / "gaits" / f"{name}-seed000.npz"
        _draw(path, str(gait) if gait.exists() else "cpg", folder / f"{name}.mcap")
    _contact_sheet([folder / f"{name}.gif" for name in models])


def _draw(model: Path, controller: str, log: Path) -> None:
    """Runs a trial, and draws its film and its strip, unless they exist."""
    trial = ("trial", str(model), "--controller", controller, "--steps", "200", "-o", str(log))
    film, strip = log.with_suffix(".gif"), log.with_suffix(".png")
    for made, command in (
        (log, trial),
        (film, ("render", str(log), "-o", str(film))),
        (strip, ("render", str(log), "-o", str(strip))),
    ):
        if not made.exists():
            subprocess.run((sys.executable, "-m", "selfmodel", *command), check=True)


def _contact_sheet(films: list[Path]) -> None:
    """Writes a figure with the logged half of a picture in the middle of each film."""
    width, height = TILE
    rows = -(-len(films) // COLUMNS)
    sheet = Image.new("RGB", (COLUMNS * width, rows * height), "white")
    for number, path in enumerate(films):
        with Image.open(path) as film:
            film.seek(getattr(film, "n_frames", 1) // 2)
            picture = film.convert("RGB")
        logged = picture.crop((0, CAPTION, picture.width // 2, picture.height - CAPTION))
        tile = logged.resize(TILE)
        draw = ImageDraw.Draw(tile)
        draw.rectangle(draw.textbbox((8, 8), path.stem), fill="white")
        draw.text((8, 8), path.stem, fill="black")
        sheet.paste(tile, (number % COLUMNS * width, number // COLUMNS * height))
    FIGURE.parent.mkdir(parents=True, exist_ok=True)
    sheet.quantize(128).save(FIGURE, optimize=True)


if __name__ == "__main__":
    main()
