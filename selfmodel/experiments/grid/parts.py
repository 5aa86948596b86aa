"""Parts of the runs in the folder of a grid: ``FOLDER/KEY/parts/PART.json``, one file each.

A file contains the result or the error of its part, and the origin of the result: the part's name,
the definition of its run, the versions, and the digest of each file that belongs to the result. A
file that is damaged, altered, or of another run is refused, and never replaced.
"""

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

from selfmodel.errors import InputError
from selfmodel.experiments.grid.definition import (
    RUN,
    Definition,
    as_json,
    listed,
    read_definition,
    runs,
)
from selfmodel.files import file_digest
from selfmodel.logs.files import make_folder, replace_file
from selfmodel.logs.result_files import (
    ResultFile,
    read_result,
    result_bytes,
    versions,
)

PARTS = "parts"
REMEDY = "delete the file, and the same command runs its part again"


@dataclass(frozen=True)
class PartResult:
    """Result of a part with the files that belong to it.

    Attributes:
        result: Result of the part, as JSON.
        files: Files that the part has read or written, such as trial logs: their digests are kept
            with the result. A file may be deleted, and may not change.
    """

    result: Any
    files: Sequence[Path] = ()


@dataclass(frozen=True)
class FinishedPart:
    """Part of a run with its result.

    Attributes:
        key: Key of the run.
        parameters: Parameters of the run.
        seed: Seed of the run.
        part: Name of the part.
        result: Result of the part, as JSON.
        path: File of the part.
        made_with: Version by package; None for a part of version 0.1, which has no digest.
    """

    key: str
    parameters: Mapping[str, Any]
    seed: int
    part: str
    result: Any
    path: Path = field(compare=False)
    made_with: Mapping[str, str] | None = field(compare=False)


def finished(folder: Path) -> Iterator[FinishedPart]:
    """Yields every finished part in the folder of a grid, in the order of the names.

    Raises:
        InputError: A file is damaged or altered, or the parts were made with different versions.
    """
    first: FinishedPart | None = None
    for run in runs(folder):
        definition, digests = read_definition(run), dict[Path, str]()
        for path in sorted((run / PARTS).glob("*.json")):
            found = _read(path, definition, digests)
            if found.content["status"] != "done":
                continue
            part = FinishedPart(
                **definition.values,
                part=unquote(path.stem),
                result=found.content["result"],
                path=path,
                made_with=found.made_with,
            )
            first = first or part
            _check_same_versions(part, first)
            yield part


def unfinished(run: Path, definition: Mapping[str, Any], parts: Sequence[str]) -> list[str]:
    """Returns the parts of a run without a result, in order.

    Args:
        run: Folder of the run.
        definition: Definition of the run, checked before.
        parts: Names of the parts.

    Raises:
        InputError: The file of a part is damaged, altered, or of another run.
    """
    # A user may have deleted the definition; without it, every part needs its digest.
    known = (
        read_definition(run)
        if (run / RUN).exists()
        else Definition(as_json(definition), versions())
    )
    digests: dict[Path, str] = {}
    return [part for part in parts if not _is_done(part_path(run, part), known, digests)]


def done(run: Path, made: PartResult) -> dict[str, Any]:
    """Returns the outcome of a finished part."""
    files = {os.path.relpath(path, run): file_digest(path) for path in made.files}
    return {"status": "done", "result": made.result, "files": files}


def failed(error: str) -> dict[str, Any]:
    """Returns the outcome of a part that failed."""
    return {"status": "failed", "error": error}


def part_bytes(definition: Mapping[str, Any], part: str, outcome: Mapping[str, Any]) -> bytes:
    """Returns the file of a part."""
    return result_bytes({**outcome, "part": part, "definition": definition})


def write_part(run: Path, part: str, data: bytes) -> None:
    """Writes the file of a part."""
    path = part_path(run, part)
    make_folder(path.parent)  # a user deletes results to run their parts again
    replace_file(path, data)


def part_path(run: Path, part: str) -> Path:
    """Returns the file of a part."""
    return run / PARTS / f"{quote(part, safe='')}.json"


def _is_done(path: Path, definition: Definition, digests: dict[Path, str]) -> bool:
    return path.exists() and _read(path, definition, digests).content["status"] == "done"


def _read(path: Path, definition: Definition, digests: dict[Path, str]) -> ResultFile:
    """Returns the verified outcome of a part.

    Args:
        path: File of the part.
        definition: Definition of its run.
        digests: SHA-256 of files that were read before; more are added.
    """
    found = read_result(path, "a part of a run", REMEDY)
    outcome = found.content
    wanted = {"done": "result", "failed": "error"}.get(str(outcome.get("status")))
    files = outcome.get("files", {})
    if wanted is None or wanted not in outcome or not isinstance(files, dict):
        raise InputError(f"{path}: expected a part of a run, got other keys or values; {REMEDY}")
    if definition.made_with is None and found.made_with is None:
        return found
    part = unquote(path.stem)
    is_own = (outcome.get("definition"), outcome.get("part")) == (definition.values, part)
    if not is_own or path != part_path(path.parents[1], part):
        raise InputError(
            f"{path}: expected the part {part} of the run {definition.values['key']}, with its "
            f"digest, got another part or no digest; {REMEDY}"
        )
    if found.made_with != definition.made_with:
        raise InputError(
            f"{path} was made with {listed(found.made_with)}, its run with "
            f"{listed(definition.made_with)}: a study is of one version of each; {REMEDY}"
        )
    _check_files(path, files, digests)
    return found


def _check_files(path: Path, files: Mapping[str, str], digests: dict[Path, str]) -> None:
    for name, digest in files.items():
        file = Path(os.path.normpath(path.parents[1] / name))
        if file not in digests and file.exists():
            digests[file] = file_digest(file)
        if digests.get(file, digest) != digest:
            raise InputError(
                f"{file} was changed after {path} was made with it: restore the file, or delete "
                f"both, and the same command makes them again"
            )


def _check_same_versions(part: FinishedPart, first: FinishedPart) -> None:
    if part.made_with != first.made_with:
        raise InputError(
            f"{part.path} was made with {listed(part.made_with)}, {first.path} with "
            f"{listed(first.made_with)}: a table is of one version of each; move the runs of other "
            f"versions into a folder of their own"
        )
