"""Cell of a study: one computation, in a folder that is named by the digest of its inputs."""

import hashlib
import json
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from selfmodel.logs import result_files

MAX_NAME = 150
"""Maximum characters of a cell's name before its digest: a file system allows 255."""


@dataclass(frozen=True, eq=False)
class Cell:
    """One computation: a function, its inputs, and the cells whose results it reads.

    Attributes:
        function: The ``Work`` that computes the cell, as ``package.module:function``.
        key: Name of the run: letters, digits, ``.``, ``_``, ``-``, ``=``, ``%``.
        parameters: All inputs of the function except the seed, as JSON.
        seed: Seed of all random numbers.
        part: Name of the cell among those of its run, such as a comparator.
        kind: Folder of the study for cells of this kind.
        needs: Cells that the function reads, each by a name of its own.
    """

    function: str
    key: str
    parameters: Mapping[str, Any]
    seed: int
    part: str = "result"
    kind: str = "runs"
    needs: Mapping[str, "Cell"] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not re.fullmatch(r"\w[\w.=%-]*", self.key, re.ASCII):
            raise ValueError(f"expected a key that is a valid folder name, got {self.key!r}")

    @cached_property
    def definition(self) -> Mapping[str, Any]:
        """Everything that determines the result but the versions, as JSON."""
        given = {
            "function": self.function,
            "key": self.key,
            "part": self.part,
            "seed": self.seed,
            "parameters": self.parameters,
            "needs": {name: cell.place for name, cell in self.needs.items()},
        }
        return dict(json.loads(json.dumps(given, allow_nan=False)))

    @cached_property
    def place(self) -> str:
        """Folder of the cell, relative to that of the study."""
        return f"{self.kind}/{folder_name(self.definition, result_files.versions())}"


Work = Callable[[Cell, Mapping[str, Path], Path], Any]
"""Function that computes a cell: from the cell, the folders of the cells that it needs, and a new
folder for its own files, it returns the result as JSON. All files that it leaves in the folder
belong to the result."""


def folder_name(definition: Mapping[str, Any], versions: Mapping[str, str]) -> str:
    """Returns the name of a cell's folder: its run and part for a reader, and its digest.

    Args:
        definition: Definition of the cell.
        versions: Version by package.
    """
    text = json.dumps([definition, dict(versions)], sort_keys=True, separators=(",", ":"))
    digest = hashlib.sha256(text.encode()).hexdigest()[:16]
    name = re.sub(r"[^\w.=%-]", "_", f"{definition['key']}-{definition['part']}", flags=re.ASCII)
    return f"{name[:MAX_NAME]}-{digest}"


def with_needs(cells: Iterable[Cell]) -> dict[str, Cell]:
    """Returns cells and all that they need by their place, each once and after its needs."""
    found: dict[str, Cell] = {}

    def add(cell: Cell) -> None:
        if cell.place not in found:
            for needed in cell.needs.values():
                add(needed)
            found[cell.place] = cell

    for cell in cells:
        add(cell)
    return found
