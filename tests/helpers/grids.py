"""Functions of cells for tests of grids, and what they note outside of the folder of the study."""

import os
import sys
import time
from collections import Counter
from pathlib import Path

from selfmodel.errors import InputError
from selfmodel.studies.cells import Cell


def calls(notes: Path) -> Counter[str]:
    """Returns how often each cell was computed, by its parameter ``name``."""
    path = notes / "calls"
    return Counter(path.read_text().split() if path.exists() else [])


def work(parameters: dict, needs: dict[str, Path], folder: Path) -> dict[str, int]:
    """Notes that it was called, waits, and fails if it is to."""
    with Path(parameters["notes"], "calls").open("a") as file:
        file.write(f"{parameters['name']}\n")
    time.sleep(parameters.get("seconds", 0))
    match parameters.get("fails"):
        case "foreseen" if not Path(parameters["notes"], "mended").exists():
            raise InputError("the cause and the cure")
        case "bug":
            raise ZeroDivisionError
        case "crash":
            os._exit(7)
    sys.stdout.write("a plug-in may print")
    (folder / "number.txt").write_text(str(parameters["seed"]))
    read = sum(int((needed / "number.txt").read_text()) for needed in needs.values())
    return {"number": 10 * parameters["seed"] + read}


def cell(notes: Path, name: str, seed: int = 0, *needs: Cell, kind: str = "runs", **more: object):
    given = {"notes": str(notes), "name": name, "seed": seed, **more}
    named = {str(number): need for number, need in enumerate(needs)}
    return Cell("tests.helpers.grids:work", name, given, named, kind)


def cells(notes: Path, count: int, **more: object) -> list[Cell]:
    """Cells that need no other."""
    return [cell(notes, f"run-{seed:02d}", seed, **more) for seed in range(count)]


def shared(notes: Path, **more: object) -> list[Cell]:
    """Three cells that need one cell of another kind."""
    need = cell(notes, "need", 5, kind="shared", **more)
    return [cell(notes, f"run-{seed}", seed, need) for seed in range(3)]
