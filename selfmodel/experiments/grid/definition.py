"""Definitions of the runs in the folder of a grid, ``FOLDER/KEY/run.json``, never overwritten."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from selfmodel.errors import InputError
from selfmodel.logs.files import make_folder, replace_file
from selfmodel.logs.result_files import read_result, result_bytes, versions

RUN = "run.json"

MAX_CLAUSE = 300
"""Maximum characters of a difference in a message: values in a file may have megabytes."""

_TYPES = {"key": str, "seed": int, "parameters": dict}


@dataclass(frozen=True)
class Definition:
    """Definition of a run, as read from its folder.

    Attributes:
        values: ``key``, ``seed`` and ``parameters`` of the run.
        made_with: Version by package; None for a run of version 0.1, which has no digests.
    """

    values: Mapping[str, Any]
    made_with: Mapping[str, str] | None


def runs(folder: Path) -> list[Path]:
    """Returns the folders of all runs of a grid, finished or not."""
    return sorted(path.parent for path in folder.glob(f"*/{RUN}"))


def read_definition(run: Path) -> Definition:
    """Returns the verified definition of a run.

    Raises:
        InputError: The file is damaged or altered, or of another run.
    """
    path = run / RUN
    what, remedy = "the definition of a run", "delete the file, and the same command writes it anew"
    found = read_result(path, what, remedy)
    values = found.content
    if {name: type(value) for name, value in values.items()} != _TYPES:
        raise InputError(f"{path}: expected {what}, got other keys or values; {remedy}")
    if values["key"] != run.name:
        raise InputError(
            f"{path}: expected the definition of the run {run.name}, got that of another run, "
            f"{_short(values['key'])!r}: delete the folder {run}, or restore its name"
        )
    return Definition(values, found.made_with)


def check_versions(folder: Path) -> None:
    """Checks that all runs in a folder were made with the installed versions.

    Raises:
        InputError: A run was made with another version of selfmodel, MuJoCo or numpy.
    """
    for run in runs(folder):
        made_with = read_definition(run).made_with
        if made_with is not None and made_with != versions():
            raise InputError(
                f"{run} was made with {listed(made_with)}, installed are {listed(versions())}: a "
                f"study is of one version of each; install those versions, or choose another folder"
            )


def listed(made_with: Mapping[str, str] | None) -> str:
    """Returns packages with their versions as text."""
    if made_with is None:
        return "selfmodel 0.1, which recorded neither digests nor the versions of MuJoCo and numpy"
    return _short(", ".join(f"{package} {version}" for package, version in made_with.items()))


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
        where = difference(read_definition(run).values["parameters"].get("shared"), shared)
        if where:
            raise InputError(
                f"{folder} contains {study} with other settings ({where}): choose another folder"
            )


def check_definition(run: Path, definition: Mapping[str, Any]) -> None:
    """Checks that a run's folder, if it exists, has the same definition.

    Raises:
        InputError: The folder has another definition; the message contains the difference.
    """
    if not (run / RUN).exists():
        return
    where = difference(read_definition(run).values, as_json(definition))
    if where:
        raise InputError(
            f"{run} contains a run with other settings ({where}): nothing is overwritten, choose "
            f"another folder, or delete {run}"
        )


def check_extensible(folder: Path) -> None:
    """Checks that a folder may have more parts.

    Raises:
        InputError: A run in the folder was made by version 0.1.
    """
    for run in runs(folder):
        if read_definition(run).made_with is None:
            raise InputError(
                f"{run} was made by {listed(None)}: finished parts of 0.1 are read, and none is "
                f"added; choose another folder, or continue with version 0.1"
            )


def write_definition(run: Path, definition: Mapping[str, Any]) -> None:
    """Writes the definition of a run, unless its folder has one."""
    if not (run / RUN).exists():
        make_folder(run)
        replace_file(run / RUN, result_bytes(definition))


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


def as_json(definition: Mapping[str, Any]) -> Any:  # noqa: ANN401  # JSON
    """Returns a definition as its file contains it: tuples are lists there."""
    return json.loads(json.dumps(definition, allow_nan=False))


def _short(text: str) -> str:
    return text if len(text) <= MAX_CLAUSE else f"{text[:MAX_CLAUSE]}..."
