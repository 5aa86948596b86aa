"""Folder of a recovery: its options, one log per trial, and the diagnoses."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from selfmodel.diagnosis.diagnosis import Diagnosis, diagnosis_from_dict
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.files import read_file
from selfmodel.logs.errors import CorruptError
from selfmodel.logs.files import make_folder, replace_file
from selfmodel.logs.results import MAX_BYTES, parse_json, read_result, result_bytes

TRIALS = "trials"
DIAGNOSES = "diagnoses.json"
RECOVERY = "recovery"
"""Folder of the run in that of a study's cell."""

OPTIONS = "options.json"
"""File of the options that no log has, written before the first trial."""


def add_diagnosis(folder: Path, diagnosis: Diagnosis) -> None:
    """Writes a diagnosis after the earlier ones of a run."""
    values = [*_values_of(folder), diagnosis.to_dict()]
    text = json.dumps(values, indent=1, allow_nan=False)
    replace_file(folder / DIAGNOSES, text.encode())


def make_run(folder: Path, *, calibrated: bool) -> None:
    """Makes the folder of a new run, which does not exist or is empty.

    ``calibrated`` is whether the self-model is fitted to the trials before the failure: a report of
    an unfinished run repeats the fit.
    """
    try:
        holds = sorted(entry.name for entry in folder.iterdir()) if folder.exists() else []
    except NotADirectoryError:
        raise InputError(f"{folder} is a file: choose a folder for the run") from None
    if holds:
        raise InputError(
            f"{folder} holds another run or other files ({', '.join(holds[:3])}): nothing is "
            f"overwritten, choose a folder that is empty or does not exist"
        )
    make_folder(folder / TRIALS)
    replace_file(folder / OPTIONS, result_bytes({"calibrated": calibrated}))


def is_calibrated(folder: Path) -> bool:
    """Returns whether the self-model of a run is fitted to the trials before the failure.

    A run of an earlier version did not record that: it counts as one with the default.
    """
    path = folder / OPTIONS
    if not path.exists():
        return True
    what, remedy = "the options of a run", "move it away, and the run counts as calibrated"
    calibrated = read_result(path, what, remedy).get("calibrated")
    if not isinstance(calibrated, bool):
        raise InputError(f"{path}: expected {what}, true or false as calibrated; {remedy}")
    return calibrated


def trial_order(path: Path) -> tuple[int, str]:
    """Returns the sort key of a log: the number before the first dash; 100 follows 99."""
    digits = path.stem.partition("-")[0]
    return (int(digits) if digits.isdecimal() else 0, path.name)


def read_diagnoses(folder: Path, space: HypothesisSpace) -> tuple[Diagnosis, ...]:
    """Returns the diagnoses in the folder of a run; none if the run has none yet."""
    with _explained(folder):
        return tuple(diagnosis_from_dict(item, space.parse) for item in _values_of(folder))


def _values_of(folder: Path) -> list[Any]:
    path = folder / DIAGNOSES
    if not path.exists():
        return []
    with _explained(folder):
        return list(parse_json(read_file(path, "diagnoses", MAX_BYTES)))


@contextmanager
def _explained(folder: Path) -> Iterator[None]:
    try:
        yield
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise CorruptError(
            folder / DIAGNOSES,
            f"expected the diagnoses of a run: {error or type(error).__name__}",
            advice="move it away; the diagnoses can be made again from the trials",
        ) from error
