"""Diagnoses of recordings by the command line of selfmodel, one JSON line each."""

import dataclasses
import hashlib
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import Any

from benchmarks.foreign.scoring.questions import Question

LIMIT = 1800
"""Longest time of one command, s."""


def score(
    out: Path, rows: Path, question_of: Callable[[str], Question], jobs: int
) -> Iterator[dict[str, Any]]:
    """Diagnoses every recording of a folder that has no row yet, and appends the rows.

    The order is that of the names' digests, so that the rows of an interrupted run are a sample.

    Args:
        out: Folder of the recordings.
        rows: File with a JSON object per line; created if it does not exist.
        question_of: Returns how the recordings of a group are diagnosed.
        jobs: Number of commands at a time.
    """
    done = {(row["name"], _key(row["asked"])) for row in read_rows(rows)}
    left = []
    for path in sorted(out.glob("*/truth.json"), key=_digest):
        question = question_of(json.loads(path.read_text())["group"])
        if (path.parent.name, _key(dataclasses.asdict(question))) not in done:
            left.append((path.parent, question))
    with ThreadPoolExecutor(jobs) as pool, rows.open("a") as file:
        for future in as_completed([pool.submit(diagnosed, *asked) for asked in left]):
            file.write(json.dumps(future.result()) + "\n")
            file.flush()
            yield future.result()


def _digest(path: Path) -> str:
    return hashlib.sha256(path.parent.name.encode()).hexdigest()


def _key(asked: dict[str, Any]) -> str:
    return json.dumps(asked, sort_keys=True)


def read_rows(path: Path) -> list[dict[str, Any]]:
    """Returns the rows of a file; none if it does not exist."""
    if not path.exists():
        return []
    return [json.loads(line) for line in path.read_text().splitlines() if line.strip()]


def diagnosed(folder: Path, question: Question) -> dict[str, Any]:
    """Imports and diagnoses one recording.

    Returns:
        Its truth, the answer of ``diagnose --json`` or None, the error, and the seconds of the
        diagnosis.
    """
    truth = json.loads((folder / "truth.json").read_text())
    row: dict[str, Any] = {
        "name": folder.name,
        "truth": truth,
        "asked": dataclasses.asdict(question),
        "answer": None,
        "error": "",
    }
    with tempfile.TemporaryDirectory() as made:
        names = ["before", *(f"after-{k + 1}" for k in range(question.trials))]
        for name in names:
            imported = _selfmodel(
                ["logs", "import", name, "--mapping", f"{name}.toml"],
                ["--out", str(Path(made, f"{name}.mcap"))],
                cwd=folder,
            )
            if imported.returncode:
                return {**row, "error": imported.stderr[-2000:], "seconds": 0.0}
        start = time.perf_counter()
        kinds = ["--kinds", question.kinds] if question.kinds else []
        found = _selfmodel(
            ["diagnose", *(f"{name}.mcap" for name in names), *kinds, *question.options],
            ["--json", "--threads", "1"],
            cwd=Path(made),
        )
        row["seconds"] = time.perf_counter() - start
    if found.returncode:
        return {**row, "error": found.stderr[-2000:]}
    return {**row, "answer": json.loads(found.stdout)}


def _selfmodel(
    first: Sequence[str], last: Sequence[str], cwd: Path
) -> subprocess.CompletedProcess[str]:
    """Runs the command line of the selfmodel that is importable here."""
    here = str(Path(__file__).resolve().parents[3])
    command = [sys.executable, "-m", "selfmodel", *first, *last]
    try:
        return subprocess.run(
            command,
            cwd=cwd,
            env={**os.environ, "PYTHONPATH": here, "OMP_NUM_THREADS": "1"},
            capture_output=True,
            text=True,
            timeout=LIMIT,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return subprocess.CompletedProcess(command, 1, "", f"more than {LIMIT} s")
