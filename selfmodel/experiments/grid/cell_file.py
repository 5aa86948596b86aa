"""Files of finished cells: ``FOLDER/KIND/NAME-DIGEST/cell.json`` beside the files of its result.

``cell.json`` contains the result and its origin: the definition of the cell, the versions, and the
digest of each file that was read or written. The folder of a cell is moved to its place as a whole,
so a cell is finished when its file stands there. A file that is damaged, altered, or of another
cell is refused, and never replaced.
"""

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from selfmodel.errors import InputError
from selfmodel.experiments.grid.cell import Cell, folder_name
from selfmodel.files import file_digest
from selfmodel.logs.result_files import read_result, result_bytes

CELL = "cell.json"
REMEDY = "delete the file, and the same command computes its cell again"

_DEFINITION = {
    "function": str,
    "key": str,
    "part": str,
    "seed": int,
    "parameters": dict,
    "needs": dict,
}


@dataclass(frozen=True)
class FinishedPart:
    """Finished cell with its result.

    Attributes:
        key: Name of the run.
        parameters: Inputs.
        seed: Seed of all random numbers.
        part: Name of the cell among those of its run.
        result: The result, as JSON.
        path: ``cell.json``, beside the other files of the cell.
        made_with: Version by package.
        files: SHA-256 of each file of the cell and of the cells that it needs, by its path relative
            to the cell's folder.
    """

    key: str
    parameters: Mapping[str, Any]
    seed: int
    part: str
    result: Any
    path: Path = field(compare=False)
    made_with: Mapping[str, str] = field(compare=False)
    files: Mapping[str, str] = field(compare=False)

    @property
    def own_files(self) -> Mapping[str, str]:
        """SHA-256 of each file in the cell's folder."""
        return {name: digest for name, digest in self.files.items() if not name.startswith("..")}


def finished(folder: Path) -> Iterator[FinishedPart]:
    """Yields every finished cell in a folder of cells, in the order of the names.

    Raises:
        InputError: A file is damaged or altered, or cells were made with different versions.
    """
    refuse_earlier(folder)
    first: FinishedPart | None = None
    digests: dict[Path, str] = {}
    for path in sorted(folder.glob(f"*/{CELL}")):
        part = read_cell(path, digests)
        first = first or part
        if part.made_with != first.made_with:
            raise InputError(
                f"{part.path} was made with {listed(part.made_with)}, {first.path} with "
                f"{listed(first.made_with)}: a table is of one version of each; move the cells of "
                f"other versions into a folder of their own"
            )
        yield part


def read_cell(path: Path, digests: dict[Path, str]) -> FinishedPart:
    """Returns a finished cell, verified.

    Args:
        path: ``cell.json``.
        digests: SHA-256 of files that were read before; more are added.

    Raises:
        InputError: The file is damaged, altered, or of another cell, or a file of the cell was
            changed. A file may be missing.
    """
    found = read_result(path, "a cell of a study", REMEDY)
    definition, files = found.content.get("cell"), found.content.get("files")
    if (
        not isinstance(definition, dict)
        or {name: type(value) for name, value in definition.items()} != _DEFINITION
        or not isinstance(files, dict)
        or "result" not in found.content
        or found.made_with is None
    ):
        raise InputError(f"{path}: expected a cell of a study, got other keys or values; {REMEDY}")
    if path.parent.name != folder_name(definition, found.made_with):
        raise InputError(
            f"{path}: expected the cell of its folder, got that of "
            f"{folder_name(definition, found.made_with)}; {REMEDY}, or restore the folder's name"
        )
    for name, digest in files.items():
        file = Path(os.path.normpath(path.parent / name))
        if file not in digests and file.exists():
            digests[file] = file_digest(file)
        if digests.get(file, digest) != digest:
            raise InputError(
                f"{file} was changed after {path} was made with it: restore the file, or delete "
                f"both, and the same command makes them again"
            )
    return FinishedPart(
        key=definition["key"],
        parameters=definition["parameters"],
        seed=definition["seed"],
        part=definition["part"],
        result=found.content["result"],
        path=path,
        made_with=found.made_with,
        files=files,
    )


def has_files(part: FinishedPart) -> bool:
    """Returns whether all files of a finished cell are in its folder: a user may delete logs."""
    return all((part.path.parent / name).exists() for name in part.own_files)


def cell_bytes(
    folder: Path,
    cell: Cell,
    result: Any,  # noqa: ANN401  # JSON
    seconds: float,
    needs: Mapping[str, FinishedPart],
) -> bytes:
    """Returns the ``cell.json`` of a cell.

    Args:
        folder: Folder with the files of the cell.
        cell: The cell.
        result: Its result, as JSON.
        seconds: Wall time of its computation, s.
        needs: The cells that it has read, by name.

    Raises:
        ValueError: The result is no JSON, or too large.
    """
    own = sorted(path for path in folder.rglob("*") if path.is_file())
    files = {path.relative_to(folder).as_posix(): file_digest(path) for path in own}
    for name, part in needs.items():
        for file, digest in part.own_files.items():
            files[f"../../{cell.needs[name].place}/{file}"] = digest
    content = {"cell": cell.definition, "result": result, "files": files, "seconds": seconds}
    return result_bytes(content)


def refuse_earlier(folder: Path) -> None:
    """Checks that a folder of cells has no run of an earlier version of selfmodel.

    Raises:
        InputError: It has one.
    """
    run = next(folder.glob("*/run.json"), None)
    if run is not None:
        raise InputError(
            f"{run} is of a study of an earlier version of selfmodel, whose folders are neither "
            f"read nor continued: its results.csv and results.json stay as they are; choose "
            f"another folder, or use the version that made it"
        )


def listed(made_with: Mapping[str, str]) -> str:
    """Returns packages with their versions as text."""
    return ", ".join(f"{package} {version}" for package, version in made_with.items())[:300]
