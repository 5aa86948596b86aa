"""Results of an ablation: rows, scores and figures, collected from its folder and written."""

import dataclasses
import json
import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from selfmodel.experiments.ablation.figures import draw
from selfmodel.experiments.ablation.rows import AblationRow
from selfmodel.experiments.ablation.scores import ComparatorScore, summarise
from selfmodel.experiments.grid import FinishedPart, finished
from selfmodel.experiments.study_files import as_csv, as_dicts, as_rows, write_files


@dataclass(frozen=True)
class AblationResults:
    """Results of an ablation and their files.

    Attributes:
        rows: All diagnoses in the folder.
        scores: Scores of the comparators.
        files: Paths of the CSV, the JSON and the figures.
        unverified: Number of parts of version 0.1, which have no digest.
    """

    rows: tuple[AblationRow, ...]
    scores: tuple[ComparatorScore, ...]
    files: tuple[Path, ...]
    unverified: int


def collect(folder: Path) -> tuple[AblationRow, ...]:
    """Returns all diagnoses in the folder of an ablation, in order.

    Raises:
        InputError: A file in the folder is damaged.
    """
    return _rows(finished(folder / "runs"))


def _rows(parts: Iterable[FinishedPart]) -> tuple[AblationRow, ...]:
    rows = [row for part in parts for row in as_rows(AblationRow, part)]
    return tuple(sorted(rows, key=lambda row: (*row.run, row.comparator, row.trials)))


def write_results(folder: Path) -> AblationResults:
    """Writes ``results.csv``, ``results.json`` and the figures of all runs in a folder.

    Raises:
        InputError: A file in the folder is damaged.
        OSError: The results cannot be written.
    """
    parts = [*finished(folder / "runs")]
    rows = _rows(parts)
    scores = summarise(rows)
    text = json.dumps(as_dict(rows, scores), indent=1, allow_nan=False)
    files = {
        "results.csv": as_csv(AblationRow, rows).encode(),
        "results.json": f"{text}\n".encode(),
        **{f"figures/{name}": data for name, data in draw(rows, scores)},
    }
    unverified = sum(part.made_with is None for part in parts)
    return AblationResults(rows, scores, write_files(folder, files), unverified)


def as_dict(rows: Iterable[AblationRow], scores: Iterable[ComparatorScore]) -> dict[str, Any]:
    """Returns rows and scores as JSON; null for an unknown number."""
    return {
        "rows": as_dicts(rows),
        "scores": [_nan_as_none(dataclasses.asdict(score)) for score in scores],
    }


def _nan_as_none(value: Any) -> Any:  # noqa: ANN401  # JSON
    if isinstance(value, dict):
        return {key: _nan_as_none(inner) for key, inner in value.items()}
    return None if isinstance(value, float) and math.isnan(value) else value
