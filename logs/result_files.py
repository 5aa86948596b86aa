"""Result files: JSON objects that contain the versions that made them and a digest.

Besides its content, a result file has the keys ``made_with``, the versions of selfmodel, MuJoCo and
numpy, and ``sha256``, the SHA-256 of all its other values in a canonical form. The digest detects
damage and changes by hand; it is no signature. Files of version 0.1 have neither key.
"""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from selfmodel.errors import InputError
from selfmodel.files import read_file

MAX_BYTES = 16 * 2**20
"""Largest JSON file that is written and read, bytes."""

MADE_WITH = "made_with"
DIGEST = "sha256"


@dataclass(frozen=True)
class ResultFile:
    """Verified content of a result file.

    Attributes:
        content: Values without versions and digest.
        made_with: Version by package; None for a file of version 0.1, which has no digest.
    """

    content: Mapping[str, Any]
    made_with: Mapping[str, str] | None


@cache
def versions() -> Mapping[str, str]:
    """Returns the installed version of each package that determines the bits of a result."""
    return {package: version(package) for package in ("selfmodel", "mujoco", "numpy")}


def result_bytes(content: Mapping[str, Any]) -> bytes:
    """Returns the bytes of a result file, with the installed versions and the digest."""
    # The digest is that of the values as a reader parses them: JSON's keys are texts.
    given = {**content, MADE_WITH: versions()}
    values = parse_json(json.dumps(given, allow_nan=False).encode())
    data = json.dumps({**values, DIGEST: _digest(values)}, indent=1, allow_nan=False).encode()
    if len(data) > MAX_BYTES:
        raise ValueError(f"expected a result of at most {MAX_BYTES} bytes as JSON, got {len(data)}")
    return data


def read_result(path: Path, what: str, remedy: str) -> ResultFile:
    """Returns the verified content of a result file.

    Args:
        path: The file.
        what: Expected content for the error message, such as "the definition of a run".
        remedy: Remedy for the error message.

    Raises:
        InputError: The file cannot be read, is too large, no valid JSON, or has a wrong digest.
    """
    try:
        return verified(parse_json(read_file(path, what, MAX_BYTES)))
    except InputError as error:
        raise InputError(f"{error}; {remedy}") from error
    except ValueError as error:
        raise InputError(f"{path}: expected {what}: {error}; {remedy}") from error


def parse_json(data: bytes) -> Any:  # noqa: ANN401  # JSON
    """Returns the values of a JSON document in UTF-8, with finite numbers and bounded nesting."""
    try:
        return json.loads(data.decode(), parse_float=_finite, parse_constant=_finite)
    except RecursionError:
        raise ValueError("its values are nested too deeply") from None


def verified(values: Any) -> ResultFile:  # noqa: ANN401  # JSON
    """Returns the content of a parsed result file, after its digest was checked."""
    if not isinstance(values, dict):
        raise ValueError("it is no JSON object")  # noqa: TRY004  # one error for all damage
    if not values.keys() & {MADE_WITH, DIGEST}:
        return ResultFile(values, None)
    content = {key: value for key, value in values.items() if key != DIGEST}
    if values.get(DIGEST) != _digest(content):
        raise ValueError("its digest is missing or wrong, so it was altered or damaged")
    made_with = content.pop(MADE_WITH, None)
    if not isinstance(made_with, dict):
        raise ValueError("it lacks the versions that made it")  # noqa: TRY004  # as above
    return ResultFile(content, made_with)


def _digest(values: Mapping[str, Any]) -> str:
    try:
        text = json.dumps(values, sort_keys=True, separators=(",", ":"), allow_nan=False)
    except RecursionError:
        raise ValueError("its values are nested too deeply") from None
    return hashlib.sha256(text.encode()).hexdigest()


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"it contains the number {text[:40]}, which is not finite")
    return number
