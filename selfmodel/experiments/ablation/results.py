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
from selfmodel.experiments.grid import finished
from selfmodel.experiments.study.files import as_csv, as_dicts, as_rows, write_files


@dataclass(frozen=True)
class AblationResults:
    """Results of an ablation and their files.

    Attributes:
        rows: All diagnoses in the folder.
        scores: Scores of the comparators.
        files: Paths of the CSV, the JSON and the figures.
    """

    rows: tuple[AblationRow, ...]
    scores: tuple[ComparatorScore, ...]
    files: tuple[Path, ...]


def collect(folder: Path) -> tuple[AblationRow, ...]:
    """Returns all diagnoses in the folder of an ablation, in order.

    Raises:
        InputError: A file in the folder is damaged.
    """
    rows = [row for part in finished(folder / "runs") for row in as_rows(AblationRow, part)]
    return tuple(sorted(rows, key=lambda row: (*row.run, row.comparator, row.trials)))


def write_results(folder: Path) -> AblationResults:
    """Writes ``results.csv``, ``results.json`` and the figures of all runs in a folder.

    Raises:
        InputError: A file in the folder is damaged.
        OSError: The results cannot be written.
    """
    rows = collect(folder)
    scores = summarise(rows)
    text = json.dumps(as_dict(rows, scores), indent=1, allow_nan=False)
    files = {
        "results.csv": as_csv(AblationRow, rows).encode(),
        "results.json": f"{text}\n".encode(),
        **{f"figures/{name}": data for name, data in draw(rows, scores)},
    }
    return AblationResults(rows, scores, write_files(folder, files))


def as_dict(rows: Iterable[AblationRow], scores: Iterable[ComparatorScore]) -> dict[str, Any]:
    """Returns rows and scores as JSON; null for an unknown number."""
    return {
        "rows": as_dicts(rows),
        "scores": [_finite_or_none(dataclasses.asdict(score)) for score in scores],
    }


def _finite_or_none(value: Any) -> Any:  # noqa: ANN401  # JSON
    if isinstance(value, dict):
        return {key: _finite_or_none(inner) for key, inner in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value
