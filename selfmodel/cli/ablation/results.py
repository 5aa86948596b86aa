"""What an ablation found: its rows in files, how often each comparator is right, and figures."""

import dataclasses
import json
import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from selfmodel.atomic import put
from selfmodel.cli.ablation.figures import draw
from selfmodel.cli.ablation.rows import Row, as_csv, as_objects
from selfmodel.cli.ablation.scores import Score, summarise
from selfmodel.grid import finished


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
    rows = collect(folder)
    scores = summarise(rows)
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / "results.csv", folder / "results.json"]
    put(files[0], as_csv(rows).encode())
    text = json.dumps(as_object(rows, scores), indent=1, allow_nan=False)
    put(files[1], f"{text}\n".encode())
    for name, data in draw(rows, scores):
        (folder / "figures").mkdir(exist_ok=True)
        files.append(folder / "figures" / name)
        put(files[-1], data)
    return Results(rows, scores, tuple(files))


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
