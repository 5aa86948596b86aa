"""Cells of a study: each a function, its parameters and the cells that it needs, in a folder.

The folder of a cell, FOLDER/KIND/NAME-DIGEST, is named by the digest of these and of the code that
computes it. It is filled under a random name and renamed when it is complete: a cell is finished if
its ``cell.json`` stands there.
"""

import errno
import hashlib
import importlib.util
import json
import os
import re
import secrets
import shutil
import time
import traceback
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Any

from selfmodel.errors import InputError, WorkError
from selfmodel.files import read_file, sync_folder
from selfmodel.logs.errors import is_full
from selfmodel.logs.files import make_folder, not_written, replace_file
from selfmodel.logs.results import digest_of, versions

CELL, UNFINISHED, ERRORS = "cell.json", "unfinished", "errors"
"""File of a finished cell; folders of the cells that are being computed, and of the failures."""

PACKAGE = Path(__file__).parents[1]
"""Folder of the code that determines the bits of every cell."""

MAX_BYTES = 2**26
"""Largest ``cell.json`` that is read, bytes."""

REMEDY = "delete its folder, and the same command computes its cell again"

Work = Callable[[Mapping[str, Any], Mapping[str, Path], Path], Any]
"""Function of a cell: from its parameters, the folders of the cells that it needs, and a new folder
for files of its own, it returns the result as JSON."""

Answer = tuple[float, str | None]
"""Wall time of a cell, s, and the reason of its failure."""


@dataclass(frozen=True, eq=False)
class Cell:
    """One computation.

    Attributes:
        function: The ``Work`` that computes the cell, as ``package.module:function``.
        name: Name for readers, which can name a folder.
        parameters: All inputs of the function, as JSON, the seed of its random numbers included.
        needs: Cells whose files the function reads, each by a name of its own.
        kind: Folder of the study for cells of this kind.
    """

    function: str
    name: str
    parameters: Mapping[str, Any]
    needs: Mapping[str, "Cell"] = field(default_factory=dict)
    kind: str = "runs"

    def __post_init__(self) -> None:
        if not re.fullmatch(r"\w[\w.=%-]*", self.name, re.ASCII):
            raise ValueError(f"expected a name that is a valid folder name, got {self.name!r}")

    @cached_property
    def definition(self) -> Mapping[str, Any]:
        """Everything that determines the result but the code, as JSON."""
        needs = {name: cell.place for name, cell in self.needs.items()}
        given = {"function": self.function, "name": self.name, "parameters": self.parameters}
        return dict(json.loads(json.dumps({**given, "needs": needs}, allow_nan=False)))

    @cached_property
    def place(self) -> str:
        """Folder of the cell, relative to that of the study."""
        return f"{self.kind}/{_folder_name(self.definition, made_with(self.function))}"


@dataclass(frozen=True)
class FinishedCell:
    """A finished cell.

    Attributes:
        name: Name for readers.
        parameters: Inputs.
        result: The result, as JSON.
        path: ``cell.json``.
        made_with: Versions, and the digest of the code, that computed the cell.
        files: Paths of its other files, relative to the folder.
    """

    name: str
    parameters: Mapping[str, Any]
    result: Any
    path: Path = field(compare=False)
    made_with: Mapping[str, str] = field(compare=False)
    files: Sequence[str] = field(compare=False)

    @property
    def has_files(self) -> bool:
        """Whether all files are in the folder: a user may delete logs."""
        return all((self.path.parent / name).exists() for name in self.files)


def finished(folder: Path) -> Iterator[FinishedCell]:
    """Yields every finished cell in a folder of cells, in the order of the names.

    All are verified, and made by the same code.
    """
    first: FinishedCell | None = None
    for path in sorted(folder.glob(f"*/{CELL}")):
        cell = read_cell(path)
        first = first or cell
        if cell.made_with != first.made_with:
            raise InputError(
                f"{path.parent} was made with {listed(cell.made_with)}, {first.path.parent} with "
                f"{listed(first.made_with)}: a table is of one version of each; move the cells of "
                f"other versions into a folder of their own"
            )
        yield cell


def compute(folder: Path, cell: Cell, made: Mapping[str, str]) -> Answer:
    """Computes a cell in a worker, unless it is finished meanwhile.

    Raises:
        InputError: The worker has other code than the command.
        OSError: The disk is full or not writable.
    """
    here = made_with(cell.function)
    if here != made:
        raise InputError(
            f"the worker on {os.uname().nodename} has {listed(here)}, the command has "
            f"{listed(made)}: a study is of one version of each; install the same there"
        )
    begin, place = time.perf_counter(), folder / cell.place
    if _is_complete(place):
        return 0.0, None
    # A new name that nobody has: no link is followed, and no file is replaced.
    unfinished = folder / UNFINISHED / f"{place.name}.{secrets.token_hex(8)}"
    try:
        for needed in (unfinished, place.parent):
            make_folder(needed, folder)
        error = _perform(folder, cell, unfinished, begin)
        if error is None:
            _publish(unfinished, place)
            (folder / ERRORS / f"{place.name}.txt").unlink(missing_ok=True)  # of an earlier failure
        return time.perf_counter() - begin, error
    except OSError as cause:
        if _is_complete(place):  # another worker was first
            return 0.0, None
        raise OSError(str(cause)) from None  # errors with arguments of their own cannot be sent
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)


def _perform(folder: Path, cell: Cell, unfinished: Path, begin: float) -> str | None:
    """Calls the function of a cell, and writes its ``cell.json`` or the reason of its failure."""
    module, _, name = cell.function.partition(":")
    try:
        with warnings.catch_warnings():
            # A result contains whether a simulation diverged; raw text does not name the cell.
            warnings.simplefilter("ignore", RuntimeWarning)
            work: Work = getattr(importlib.import_module(module), name)
            needs = {key: folder / need.place for key, need in cell.needs.items()}
            result = work(cell.parameters, needs, unfinished)
        paths = sorted(path for path in unfinished.rglob("*") if path.is_file())
        content = {
            "cell": cell.definition,
            "result": result,
            "files": [path.relative_to(unfinished).as_posix() for path in paths],
            "seconds": time.perf_counter() - begin,
            "made_with": made_with(cell.function),
        }
        text = json.dumps({**content, "sha256": digest_of(content)}, indent=1, allow_nan=False)
    except (OSError, InputError, WorkError, MemoryError) as cause:
        if isinstance(cause, OSError) and is_full(cause):
            raise not_written(cause.filename or unfinished, cause) from cause
        reason = str(cause) or type(cause).__name__
        keep_error(folder, cell.place, reason)
        return reason
    except Exception as cause:  # noqa: BLE001  # a plug-in may raise any exception
        keep_error(folder, cell.place, "".join(traceback.format_exception(cause)))
        line = " ".join(traceback.format_exception_only(cause)[-1].split())[:300]
        return f"an unexpected error, {line}; its traceback is in {folder / ERRORS}"
    replace_file(unfinished / CELL, f"{text}\n".encode())
    return None


def keep_error(folder: Path, place: str, text: str) -> None:
    """Writes the error of a cell into its file."""
    make_folder(folder / ERRORS, folder)
    path = folder / ERRORS / f"{Path(place).name}.txt"
    replace_file(path, f"{text}\n".encode(errors="replace"))


def _publish(unfinished: Path, place: Path) -> None:
    """Moves the folder of a cell to its place; of two workers, the first one keeps it."""
    sync_folder(unfinished)
    try:
        unfinished.rename(place)
    except OSError as error:
        if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
            raise not_written(place, error) from error
        if _is_complete(place):
            return
        # A cell without its result, or without files that are needed again.
        old = place.rename(unfinished.with_name(f"{unfinished.name}.old"))
        unfinished.rename(place)
        shutil.rmtree(old, ignore_errors=True)
    sync_folder(place.parent)


def _is_complete(place: Path) -> bool:
    return (place / CELL).exists() and read_cell(place / CELL).has_files


def read_cell(path: Path) -> FinishedCell:
    """Returns a finished cell; one that is damaged, altered, or of another cell is refused."""
    data = read_file(path, "a cell of a study", MAX_BYTES)
    try:
        content = json.loads(data)
        digest = content.pop("sha256")
        cell, made = content["cell"], content["made_with"]
        finished_cell = FinishedCell(
            cell["name"], cell["parameters"], content["result"], path, made, content["files"]
        )
        is_whole = digest == digest_of(content) and path.parent.name == _folder_name(cell, made)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise InputError(f"{path}: expected a cell of a study, got {error!r}; {REMEDY}") from error
    if not is_whole:
        raise InputError(f"{path} was altered or damaged, or its folder renamed: {REMEDY}")
    return finished_cell


@cache
def made_with(function: str) -> dict[str, str]:
    """Returns what determines the bits of a cell besides its definition.

    It is the versions of selfmodel, MuJoCo and numpy, and the digest of the code: of all modules
    and models of selfmodel, and of the function's module.
    """
    files = [
        Path(folder, name)
        for folder, _, names in os.walk(PACKAGE, followlinks=True)
        for name in names
        if name.endswith((".py", ".xml"))
    ]
    code = {path.relative_to(PACKAGE).as_posix(): path.read_bytes() for path in files}
    module = importlib.util.find_spec(function.partition(":")[0])
    if module is not None and module.origin and not module.name.startswith("selfmodel."):
        code[""] = Path(module.origin).read_bytes()
    digests = {name: hashlib.sha256(content).hexdigest() for name, content in code.items()}
    return {**versions(), "code": digest_of(digests)[:16]}


def _folder_name(definition: Mapping[str, Any], made: Mapping[str, str]) -> str:
    return f"{definition['name'][:150]}-{digest_of([definition, made])[:16]}"


def listed(made: Mapping[str, str]) -> str:
    """Returns versions and the digest of the code as text."""
    return ", ".join(f"{name} {value}" for name, value in made.items())[:300]
