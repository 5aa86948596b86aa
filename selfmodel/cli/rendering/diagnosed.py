"""The best hypothesis in the file of a diagnosis."""

from pathlib import Path

from selfmodel.errors import InputError
from selfmodel.files import read_file
from selfmodel.logs.result_files import MAX_BYTES, parse_json, verified


def diagnosed(path: Path) -> str:
    """Returns the notation of the best hypothesis of a diagnosis.

    Args:
        path: ``result.json`` or ``diagnoses.json`` of a recovery (the last diagnosis counts), or
            the output of ``diagnose --json`` or ``recover --json``.

    Raises:
        InputError: The file is none of these, or a ``result.json`` with a wrong digest.
    """
    data = read_file(path, "a diagnosis as JSON", MAX_BYTES)
    try:
        found = parse_json(data)
        ranked = (
            found[-1]["ranked"] if isinstance(found, list) else verified(found).content["diagnosis"]
        )
        best = ranked[0]["hypothesis"]
    except ValueError as error:
        raise _no_diagnosis(path, f": {error}") from error
    except (LookupError, TypeError):
        raise _no_diagnosis(path) from None
    if not isinstance(best, str):
        raise _no_diagnosis(path)
    return best


def _no_diagnosis(path: Path, reason: str = "") -> InputError:
    return InputError(
        f"{path}: expected a diagnosis: the result.json or diagnoses.json of a recovery, or the "
        f"output of selfmodel diagnose --json{reason}"
    )
