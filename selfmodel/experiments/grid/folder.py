"""Files of a grid: a folder per run, with its definition and one JSON file per part.

``FOLDER/KEY/run.json`` is the definition of a run and is never overwritten;
``FOLDER/KEY/parts/PART.json`` is the result or the error of one part. Every write is atomic.
"""

import fcntl
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

from selfmodel.errors import InputError
from selfmodel.logs.atomic import write_atomic

PARTS = "parts"
RUN = "run.json"


@dataclass(frozen=True)
class FinishedPart:
    """Part of a run with its result.

    Attributes:
        key: Key of the run.
        parameters: Parameters of the run.
        seed: Seed of the run.
        part: Name of the part.
        result: Result of the part, as JSON.
    """

    key: str
    parameters: Mapping[str, Any]
    seed: int
    part: str
    result: Any


def finished(folder: Path) -> Iterator[FinishedPart]:
    """Yields every finished part in the folder of a grid, in the order of the names.

    Raises:
        InputError: A file is damaged.
    """
    for run in runs(folder):
        definition = _read(run / RUN)
        for path in sorted((run / PARTS).glob("*.json")):
            outcome = _read(path)
            if outcome["status"] == "done":
                yield FinishedPart(
                    key=definition["key"],
                    parameters=definition["parameters"],
                    seed=definition["seed"],
                    part=unquote(path.stem),
                    result=outcome["result"],
                )


def runs(folder: Path) -> list[Path]:
    """Returns the folders of all runs of a grid, finished or not."""
    return sorted(path.parent for path in folder.glob(f"*/{RUN}"))


def check_shared(folder: Path, shared: Mapping[str, Any], study: str) -> None:
    """Checks that all runs in the folder of a study have the same shared parameters.

    Args:
        folder: Folder of the study; its runs are in ``runs``.
        shared: Required value of the parameter ``shared`` of every run.
        study: Name of the study with its article, for the message.

    Raises:
        InputError: A run has other shared parameters; the message contains the difference.
    """
    for run in runs(folder / "runs"):
        where = difference(_read(run / RUN)["parameters"]["shared"], shared)
        if where:
            raise InputError(
                f"{folder} contains {study} with other settings ({where}): choose another folder"
            )


def difference(there: Any, requested: Any, name: str = "") -> str | None:  # noqa: ANN401  # JSON
    """Returns the first difference of two JSON values as a clause; None if they are equal."""
    if isinstance(there, dict) and isinstance(requested, dict):
        for key in sorted(there.keys() | requested.keys()):
            inner = difference(there.get(key), requested.get(key), f"{name}.{key}".lstrip("."))
            if inner:
                return inner
        return None
    if there == requested:
        return None
    return f"{name} is {json.dumps(there)} there, requested is {requested!r}"


@contextmanager
def exclusive(folder: Path) -> Iterator[None]:
    """Context manager that reserves the folder of a grid, made if missing, for this process.

    Raises:
        InputError: Another process runs a grid in the folder.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with folder.with_name(f"{folder.name}.lock").open("wb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # released when the file is closed
        except BlockingIOError as error:
            raise InputError(
                f"another process runs a grid in {folder}: wait for its end, or choose another "
                f"folder"
            ) from error
        yield


def check_definition(run: Path, definition: Mapping[str, Any]) -> None:
    """Checks that a run's folder, if it exists, has the same definition.

    Raises:
        InputError: The folder has another definition; the message contains the difference.
    """
    if not (run / RUN).exists():
        return
    where = difference(_read(run / RUN), _as_json(definition))
    if where:
        raise InputError(
            f"{run} contains a run with other settings ({where}): nothing is overwritten, choose "
            f"another folder, or delete {run}"
        )


def write_definition(run: Path, definition: Mapping[str, Any]) -> None:
    """Writes the definition of a run, unless its folder has one."""
    if not (run / RUN).exists():
        run.mkdir(parents=True, exist_ok=True)
        write_atomic(run / RUN, _encoded(_as_json(definition)))


def is_finished(run: Path, part: str) -> bool:
    """Returns whether a part of a run has a result."""
    path = _path(run, part)
    return path.exists() and _read(path)["status"] == "done"


def write_part(run: Path, part: str, outcome: Mapping[str, Any]) -> None:
    """Writes the result or the error of a part."""
    path = _path(run, part)
    path.parent.mkdir(exist_ok=True)  # a user deletes results to run their parts again
    write_atomic(path, _encoded(outcome))


def _path(run: Path, part: str) -> Path:
    return run / PARTS / f"{quote(part, safe='')}.json"


def _as_json(definition: Mapping[str, Any]) -> Any:  # noqa: ANN401  # JSON
    return json.loads(json.dumps(definition, allow_nan=False))  # tuples are lists in a file


def _encoded(value: Mapping[str, Any]) -> bytes:
    return json.dumps(value, indent=1, allow_nan=False).encode()


def _read(path: Path) -> Any:  # noqa: ANN401  # JSON
    try:
        return json.loads(path.read_bytes())
    except ValueError as error:
        raise InputError(
            f"{path}: expected a JSON file of a grid ({error}): delete the folder of the run to "
            f"run it again"
        ) from error
