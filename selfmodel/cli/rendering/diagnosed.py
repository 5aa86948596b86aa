"""The best hypothesis of a diagnosis that a command wrote down."""

import json
from pathlib import Path

from selfmodel.errors import InputError
from selfmodel.files import read_file

LARGEST = 16 * 2**20
"""Bytes that a diagnosis in a file may have."""


def diagnosed(path: Path) -> str:
    """Returns the notation of the hypothesis that a diagnosis puts first.

    Args:
        path: What ``recover`` left in its folder (``result.json``; ``diagnoses.json``, of which the
            last counts), or what ``diagnose --json`` or ``recover --json`` printed.

    Raises:
        InputError: The file cannot be read as one of them.
    """
    data = read_file(path, "a diagnosis as JSON", LARGEST)
    try:
        found = json.loads(data)
        ranked = found[-1]["ranked"] if isinstance(found, list) else found["diagnosis"]
        best = ranked[0]["hypothesis"]
    except (ValueError, LookupError, TypeError, RecursionError):
        best = None
    if not isinstance(best, str):
        raise InputError(
            f"{path}: expected a diagnosis: the result.json or diagnoses.json of a recovery, or "
            f"what selfmodel diagnose --json prints"
        )
    return best
