"""Checks of the folder of a study before anything is computed, and differences of JSON values."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from selfmodel.errors import InputError
from selfmodel.experiments.grid.cell import Cell
from selfmodel.experiments.grid.cell_file import (
    CELL,
    FinishedPart,
    finished,
    listed,
    read_cell,
    refuse_earlier,
)
from selfmodel.logs import result_files

MAX_CLAUSE = 300
"""Maximum characters of a difference in a message: values in a file may have megabytes."""


def check_runs(folder: Path, cells: Sequence[Cell], study: str) -> None:
    """Checks that the runs in the folder of a study, with cells to compute, make one table.

    All have the same parameter ``shared``, those of a robot have the same ``model``, and no run has
    been made with other inputs, such as another gait.

    Args:
        folder: Folder of the study; its runs are in ``runs``.
        cells: Cells of runs.
        study: Name of the study with its article, for the message.

    Raises:
        InputError: A run has other inputs; the message contains the difference.
    """
    places = {(cell.key, cell.part): cell.place for cell in cells}
    models = {cell.parameters.get("robot"): cell.parameters.get("model") for cell in cells}
    for run in finished(folder / "runs") if cells else ():
        there = run.parameters
        model = models.get(there.get("robot"), there.get("model"))
        where = difference(there.get("shared"), cells[0].parameters.get("shared")) or difference(
            there.get("model"), model, f"the model of {there.get('robot')}"
        )
        if where:
            raise InputError(
                f"{folder} contains {study} with other settings ({where}): choose another folder"
            )
        name = run.path.parent.name
        place = Path(places.get((run.key, run.part), name)).name
        if run.made_with == result_files.versions() and place != name:
            raise InputError(
                f"{folder} contains {run.key}, {run.part}, made with other inputs, such as another "
                f"gait: choose another folder, or delete {run.path.parent}"
            )


def read_study(folder: Path) -> dict[str, FinishedPart]:
    """Returns all finished cells in the folder of a study by their place, verified.

    Raises:
        InputError: A file is damaged or altered, a cell was made with another version of
            selfmodel, MuJoCo or numpy, or an earlier selfmodel made the folder.
    """
    for kind in filter(Path.is_dir, folder.glob("*")):
        refuse_earlier(kind)
    found: dict[str, FinishedPart] = {}
    digests: dict[Path, str] = {}
    for path in sorted(folder.glob(f"*/*/{CELL}")):
        part = read_cell(path, digests)
        if part.made_with != result_files.versions():
            raise InputError(
                f"{path.parent} was made with {listed(part.made_with)}, installed are "
                f"{listed(result_files.versions())}: a study is of one version of each; install "
                f"those versions, or choose another folder"
            )
        found[path.parent.relative_to(folder).as_posix()] = part
    return found


def refused_versions(worker: str, own: Mapping[str, str], versions: Mapping[str, str]) -> str:
    """Returns the refusal of a worker that has other versions than the command.

    Args:
        worker: The worker with its article and host.
        own: Its version by package.
        versions: Those of the command.
    """
    return (
        f"{worker} has {listed(own)}, this command has {listed(versions)}: a study is of one "
        f"version of each; install the same there"
    )


def difference(there: Any, requested: Any, name: str = "") -> str | None:  # noqa: ANN401  # JSON
    """Returns the first difference of two JSON values as a clause; None if they are equal."""
    if isinstance(there, dict) and isinstance(requested, dict):
        for key in sorted(there.keys() | requested.keys()):
            values = there.get(key, _ABSENT), requested.get(key, _ABSENT)
            inner = difference(*values, f"{name}.{key}".lstrip("."))
            if inner:
                return inner
        return None
    if there == requested:
        return None
    found = "absent" if there is _ABSENT else _short(json.dumps(there))
    wanted = "none" if requested is _ABSENT else repr(requested)
    return f"{_short(name)} is {found} there, requested is {wanted}"


_ABSENT = object()
"""Value of a key that only the other object has; null is a value."""


def _short(text: str) -> str:
    return text if len(text) <= MAX_CLAUSE else f"{text[:MAX_CLAUSE]}..."
