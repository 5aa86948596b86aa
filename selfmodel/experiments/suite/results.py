"""Results of a study of many bodies: rows and summaries, collected from its folder and written."""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from selfmodel.experiments.grid import FinishedPart, finished
from selfmodel.experiments.study.files import as_csv, as_dicts, as_rows, write_files
from selfmodel.experiments.suite.rows import SuiteRow, Summary, summarise


@dataclass(frozen=True)
class SuiteResults:
    """Results of a study and their files.

    Attributes:
        rows: All recoveries in the folder.
        summaries: Summaries of the rows.
        files: Paths of the CSV and the JSON.
    """

    rows: tuple[SuiteRow, ...]
    summaries: tuple[Summary, ...]
    files: tuple[Path, ...]

    def as_dict(self) -> dict[str, Any]:
        """Returns rows and summaries as JSON."""
        return _as_dict(self.rows, self.summaries)


def collect(folder: Path) -> tuple[SuiteRow, ...]:
    """Returns all recoveries in the folder of a study, in order.

    Raises:
        InputError: A file in the folder is damaged.
    """
    return _rows(finished(folder / "runs"))


def _rows(parts: Iterable[FinishedPart]) -> tuple[SuiteRow, ...]:
    found = [row for part in parts for row in as_rows(SuiteRow, part)]
    return tuple(sorted(found, key=lambda row: (row.robot, row.case, row.seed)))


def write_results(folder: Path) -> SuiteResults:
    """Writes ``results.csv`` and ``results.json`` of all runs in the folder of a study.

    Raises:
        InputError: A file in the folder is damaged.
        OSError: The results cannot be written.
    """
    parts = [*finished(folder / "runs")]
    rows = _rows(parts)
    summaries = summarise(rows)
    text = json.dumps(_as_dict(rows, summaries), indent=1, allow_nan=False)
    files = {
        "results.csv": as_csv(SuiteRow, rows).encode(),
        "results.json": f"{text}\n".encode(),
    }
    return SuiteResults(rows, summaries, write_files(folder, files))


def _as_dict(rows: tuple[SuiteRow, ...], summaries: tuple[Summary, ...]) -> dict[str, Any]:
    return {"rows": as_dicts(rows), "summaries": as_dicts(summaries)}
