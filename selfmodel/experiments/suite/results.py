"""What a study found, in files."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from selfmodel.experiments.grid import finished
from selfmodel.experiments.suite.rows import Row, Summary, as_csv, as_objects, summarise
from selfmodel.logs.atomic import lock_folder, write_atomic


@dataclass(frozen=True)
class Results:
    """What was found, and where it was written.

    Attributes:
        rows: Every recovery in the folder.
        summaries: What they come to.
        files: The CSV and the JSON.
    """

    rows: tuple[Row, ...]
    summaries: tuple[Summary, ...]
    files: tuple[Path, ...]

    def as_object(self) -> dict[str, Any]:
        """Returns it as JSON has it."""
        return {"rows": as_objects(self.rows), "summaries": as_objects(self.summaries)}


def write_results(folder: Path) -> Results:
    """Writes ``results.csv`` and ``results.json`` of all that is in the folder of a study.

    Raises:
        InputError: A file in it is damaged.
        OSError: They cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with lock_folder(folder):  # several may end at once
        found = [Row(**row) for part in finished(folder / "runs") for row in part.result]
        rows = tuple(sorted(found, key=lambda row: (row.robot, row.case, row.seed)))
        files = (folder / "results.csv", folder / "results.json")
        results = Results(rows, summarise(rows), files)
        write_atomic(files[0], as_csv(rows).encode())
        text = json.dumps(results.as_object(), indent=1, allow_nan=False)
        write_atomic(files[1], f"{text}\n".encode())
    return results
