"""Cells of a study: each a function, its parameters and the cells that it needs, in a folder.

The folder of a cell, FOLDER/KIND/NAME-DIGEST, is named by the digest of these and of the code that
computes it. It is filled under a random name and renamed when it is complete: a cell is finished if
its ``cell.json`` stands there. One of an earlier source of a plug-in moves to FOLDER/earlier.
"""

import errno
import hashlib
import importlib
import json
import os
import re
import secrets
import shutil
import time
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Any

from selfmodel.errors import InputError, WorkError, typed
from selfmodel.files import path_of, read_file, sync_folder
from selfmodel.logs.errors import is_full
from selfmodel.logs.files import make_folder, not_written, replace_file
from selfmodel.logs.results import digest_of, versions

CELL, UNFINISHED, ERRORS, EARLIER = "cell.json", "unfinished", "errors", "earlier"
"""File of a finished cell; folders of the cells that are being computed, of the failures, and of
finished cells that earlier sources of a plug-in made."""

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


@typed
@dataclass(frozen=True, eq=False)
class Cell:
    """One computation.

    Attributes:
        function: The ``Work`` that computes the cell, as ``package.module:function``.
        name: Name for readers, which can name a folder.
        parameters: All inputs of the function, as JSON, the seed of its random numbers included.
        needs: Cells whose files the function reads, each by a name of its own.
        kind: Folder of the study for cells of this kind.
        modules: Modules of the plug-ins that the function calls; their source determines the
            result, as that of the function's own module does.
    """

    function: str
    name: str
    parameters: Mapping[str, Any]
    needs: Mapping[str, "Cell"] = field(default_factory=dict)
    kind: str = "runs"
    modules: Sequence[str] = ()

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
        return f"{self.kind}/{_folder_name(self.definition, self.made_with())}"

    @cached_property
    def every_module(self) -> tuple[str, ...]:
        """Modules of the function and of its plug-ins, and those of the cells that it needs."""
        own = {self.function.partition(":")[0], *self.modules}
        return tuple(sorted(own.union(*(need.every_module for need in self.needs.values()))))

    def made_with(self) -> dict[str, str]:
        """Returns what determines the bits of the cell here, besides its definition.

        It is the versions of selfmodel, MuJoCo, numpy and cma, the digest of all modules and models
        of selfmodel as ``code``, and the digest of each file of other code; see ``sources_of``.
        """
        from selfmodel.studies.sources import sources_of  # noqa: PLC0415  # few recoveries name one

        return {**package_versions(), **sources_of(self.every_module)}


@dataclass(frozen=True)
class FinishedCell:
    """A finished cell.

    Attributes:
        name: Name for readers.
        parameters: Inputs.
        result: The result, as JSON.
        path: ``cell.json``.
        made_with: Versions, and digests of the code, that computed the cell; see
            ``Cell.made_with``.
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
    known: dict[str, tuple[str, Path]] = {}
    for cell in read_cells(path_of(folder, "a folder of cells")):
        for name, version in cell.made_with.items():
            other, first = known.setdefault(name, (version, cell.path.parent))
            if other != version:
                raise InputError(
                    f"{cell.path.parent} was made with {name} {version}, {first} with {other}: a "
                    f"table is of one version of each; run the study again, which moves the cells "
                    f"of an earlier plug-in aside; those of another selfmodel need a folder of "
                    f"their own"
                )
        yield cell


def read_cells(folder: Path) -> Iterator[FinishedCell]:
    """Yields every finished cell in a folder of cells, verified, in the order of the names."""
    yield from map(read_cell, sorted(folder.glob(f"*/{CELL}")))


def versions_of(cells: Iterable[Cell]) -> dict[str, str]:
    """Returns what cells are made with here, all of them together."""
    return {name: version for cell in cells for name, version in cell.made_with().items()}


def changed(made: Mapping[str, str], here: Mapping[str, str]) -> list[str]:
    """Returns the names of what made a cell and has another version here."""
    return [name for name, version in made.items() if here.get(name, version) != version]


def compute(folder: Path, cell: Cell, made: Mapping[str, str]) -> Answer:
    """Computes a cell in a worker, unless it is finished meanwhile.

    Raises:
        InputError: The worker has other code than the command.
        OSError: The disk is full or not writable.
    """
    here = cell.made_with()
    if here != made:
        own, wanted = difference(here, made)
        raise InputError(
            f"the worker on {os.uname().nodename} has {own}, the command has {wanted}: a study is "
            f"of one version of each; install the same there, and start again what began before a "
            f"file changed"
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
            "made_with": cell.made_with(),
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


def move(folder: Path, place: str, *, aside: bool) -> None:
    """Moves the folder of a cell of an earlier source to FOLDER/earlier, or from there."""
    known = folder / place, folder / EARLIER / place
    source, target = known if aside else known[::-1]
    make_folder(target.parent, folder)
    try:
        shutil.rmtree(target, ignore_errors=True)  # of the same digest, or without its result
        source.rename(target)
    except OSError as error:
        raise not_written(target, error) from error
    sync_folder(target.parent)


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


def is_source(name: str) -> bool:
    """Returns whether what made a cell is a file of code outside of selfmodel, and no version."""
    return bool(Path(name).suffix)


@cache
def package_versions() -> dict[str, str]:
    """Returns the versions, and the digest of the code of selfmodel."""
    files = [
        Path(folder, name)
        for folder, _, names in os.walk(PACKAGE, followlinks=True)
        for name in names
        if name.endswith((".py", ".xml"))
    ]
    code = {path.relative_to(PACKAGE).as_posix(): path.read_bytes() for path in files}
    digests = {name: hashlib.sha256(content).hexdigest() for name, content in code.items()}
    return {**versions(), "code": digest_of(digests)[:16]}


def _folder_name(definition: Mapping[str, Any], made: Mapping[str, str]) -> str:
    return f"{definition['name'][:150]}-{digest_of([definition, made])[:16]}"


def difference(one: Mapping[str, str], other: Mapping[str, str]) -> tuple[str, str]:
    """Returns what differs in the versions and digests of two, as texts."""
    names = [name for name in {**one, **other} if one.get(name) != other.get(name)]
    first, second = (
        ", ".join(f"{name} {made.get(name, 'absent')}" for name in names) for made in (one, other)
    )
    return first, second
