"""What an ablation found: its rows in files, how often each comparator is right, and figures."""

import dataclasses
import json
import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from selfmodel.experiments.ablation.figures import draw
from selfmodel.experiments.ablation.rows import Row, as_csv, as_objects
from selfmodel.experiments.ablation.scores import Score, summarise
from selfmodel.experiments.grid import finished
from selfmodel.logs.atomic import lock_folder, write_atomic


@dataclass(frozen=True)
class Results:
    """What was found, and where it was written.

    Attributes:
        rows: Every diagnosis in the folder.
        scores: What they amount to.
        files: The CSV, the JSON and the figures.
    """

    rows: tuple[Row, ...]
    scores: tuple[Score, ...]
    files: tuple[Path, ...]


def collect(folder: Path) -> tuple[Row, ...]:
    """Returns every diagnosis that was made in the folder of an ablation, in order.

    Raises:
        InputError: A file in it is damaged.
    """
    rows = [Row(**row) for part in finished(folder / "runs") for row in part.result]
    return tuple(sorted(rows, key=lambda row: (*row.run, row.comparator, row.trials)))


def write_results(folder: Path) -> Results:
    """Writes ``results.csv``, ``results.json`` and the figures of all that is in a folder.

    Raises:
        InputError: A file in it is damaged.
        OSError: They cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with lock_folder(folder):  # on a cluster several may end at once
        rows = collect(folder)
        scores = summarise(rows)
        found = json.dumps(as_object(rows, scores), indent=1, allow_nan=False)
        files = {"results.csv": as_csv(rows).encode(), "results.json": f"{found}\n".encode()}
        files |= {f"figures/{name}": data for name, data in draw(rows, scores)}
        for name, data in files.items():
            (folder / name).parent.mkdir(exist_ok=True)
            write_atomic(folder / name, data)
    return Results(rows, scores, tuple(folder / name for name in files))


def as_object(rows: Iterable[Row], scores: Iterable[Score]) -> dict[str, Any]:
    """Returns what was found as JSON has it: null where a number is not known."""
    return {
        "rows": as_objects(rows),
        "scores": [_known(dataclasses.asdict(score)) for score in scores],
    }


def _known(value: Any) -> Any:  # noqa: ANN401  # JSON
    if isinstance(value, dict):
        return {key: _known(inner) for key, inner in value.items()}
    return None if isinstance(value, float) and math.isnan(value) else value
