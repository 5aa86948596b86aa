"""The best hypothesis in the file of a diagnosis."""

import json
from pathlib import Path

from selfmodel.errors import InputError
from selfmodel.files import read_file

MAX_BYTES = 16 * 2**20
"""Largest file of a diagnosis, bytes."""


def diagnosed(path: Path) -> str:
    """Returns the notation of the best hypothesis of a diagnosis.

    Args:
        path: ``result.json`` or ``diagnoses.json`` of a recovery (the last diagnosis counts), or
            the output of ``diagnose --json`` or ``recover --json``.

    Raises:
        InputError: The file is none of these.
    """
    data = read_file(path, "a diagnosis as JSON", MAX_BYTES)
    try:
        found = json.loads(data)
        ranked = found[-1]["ranked"] if isinstance(found, list) else found["diagnosis"]
        best = ranked[0]["hypothesis"]
    except (ValueError, LookupError, TypeError, RecursionError):
        best = None
    if not isinstance(best, str):
        raise InputError(
            f"{path}: expected a diagnosis: the result.json or diagnoses.json of a recovery, or "
            f"the output of selfmodel diagnose --json"
        )
    return best
