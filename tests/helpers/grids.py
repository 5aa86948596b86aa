"""Functions of cells for tests of grids, and what they note outside of the folder of the study."""

import os
from collections import Counter
from pathlib import Path

from selfmodel.experiments.grid import Cell


def note_call(cell: Cell) -> None:
    """Notes that a cell is computed, in the folder of its parameter ``notes``."""
    with Path(cell.parameters["notes"], "calls").open("a") as file:
        file.write(f"{cell.key} {cell.part} {os.getpid()}\n")


def calls(notes: Path) -> Counter[str]:
    """Returns how often each cell was computed, by key and part."""
    path = notes / "calls"
    lines = path.read_text().splitlines() if path.exists() else []
    return Counter(line.rpartition(" ")[0] for line in lines)


def work(cell: Cell, needs: dict[str, Path], _folder: Path) -> dict[str, int]:
    """Notes that it was called, and ends its process if it is to."""
    note_call(cell)
    if cell.parameters["crash"]:
        os._exit(7)
    return {"number": cell.seed, "needs": len(needs)}


def cells(notes: Path, count: int, *, crash: bool = False) -> list[Cell]:
    """Cells that need one other cell."""
    function, given = "tests.helpers.grids:work", {"notes": str(notes), "crash": crash}
    need = Cell(function, "need", {**given, "crash": False}, 0, kind="shared")
    name = "crash" if crash else "run"
    return [Cell(function, f"{name}-{n:02d}", given, n, needs={"it": need}) for n in range(count)]
