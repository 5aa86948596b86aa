"""Rows of benchmarks: files of JSON lines that commands add to, and their tables in Markdown."""

import argparse
import json
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import islice
from pathlib import Path
from statistics import median
from typing import Any

import pandas as pd

import selfmodel
from selfmodel import Controller, Robot, Settings
from selfmodel.logs import load_controller, save_controller
from selfmodel.studies.statistics import proportion
from selfmodel.studies.study import Row, grouped
from selfmodel.studies.tables import Table, markdown_of


def read_rows(path: Path) -> list[Row]:
    """Returns the rows of a file."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return [json.loads(line) for line in lines if line.strip()]


def add_rows(
    path: Path, keys: Iterable[Row], limit: int | None, values_of: Callable[[Row, Path], Row]
) -> None:
    """Appends a row for each key that has none yet, at most ``limit``, and prints it.

    A row is its key, the values and, if these have none, the seconds of processor time. The values
    are of a key and an empty folder, which is removed.
    """
    done = read_rows(path) if path.exists() else []
    new = (key for key in keys if not any(key.items() <= row.items() for row in done))
    for key in islice(new, limit):
        start = time.process_time()
        with tempfile.TemporaryDirectory() as work:
            row = {**key, **values_of(key, Path(work))}
        row.setdefault("seconds", round(time.process_time() - start))
        with path.open("a", encoding="utf-8") as file:
            file.write(f"{json.dumps(row)}\n")
        print(json.dumps(row), flush=True)


# ---------------------------------------------------------------- commands


def add_search(command: argparse.ArgumentParser) -> None:
    """Adds the options of the size of a search, and of how many rows are new."""
    command.add_argument("--limit", type=int, help="number of new rows")
    command.add_argument("--population", type=int, default=Settings.population)
    command.add_argument("--generations", type=int, default=Settings.generations)


def settings_of(given: argparse.Namespace, steps: int) -> Settings:
    """Returns the settings of trials of some control steps; see ``add_search``."""
    trials = getattr(given, "trials", Settings.trials)
    small = Settings(steps=steps, trials=trials, generations=given.generations)
    return small.scaled(given.population)


def parsed(
    parser: argparse.ArgumentParser,
    commands: "argparse._SubParsersAction[argparse.ArgumentParser]",
    table: Callable[[Sequence[Row]], str],
) -> argparse.Namespace:
    """Returns the options of a command that adds rows; the command ``table`` is run here."""
    commands.add_parser("table", help="print tables of the rows of files")
    for name, command in commands.choices.items():
        files = "+" if name == "table" else None
        command.add_argument("rows", type=Path, nargs=files, help="file of the rows, JSON lines")
    given = parser.parse_args()
    if given.command == "table":
        print(table([row for path in given.rows for row in read_rows(path)]))
        raise SystemExit
    return given


def kept_gait(path: Path, robot: Robot, **search: Any) -> Controller:  # noqa: ANN401  # of evolve
    """Returns the first gait of a robot: of a file, or evolved with these arguments and kept."""
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        save_controller(path, selfmodel.evolve(robot, threads=1, **search))
    return load_controller(path)


# ---------------------------------------------------------------- tables


def lines_of(
    rows: Iterable[Row],
    headings: Mapping[str, str],
    columns: Callable[[Sequence[Row]], Mapping[str, str]],
) -> list[dict[str, str]]:
    """Returns a line for the rows with the same values of some columns, by their headings."""
    return [
        {**dict(zip(headings.values(), map(str, key), strict=True)), **columns(own)}
        for key, own in grouped(rows, *headings).items()
    ]


def markdown(lines: Sequence[Mapping[str, str]], texts: int) -> str:
    """Returns lines as a table whose first columns, ``texts`` of them, are texts."""
    shown = pd.DataFrame(lines)
    return markdown_of(Table("", shown, shown, texts)) if lines else ""


def rate(values: Sequence[bool]) -> str:
    """Returns the share of true values with Wilson's 95 % interval, as text."""
    if not values:
        return ""
    found = proportion(sum(values), len(values))
    return (
        f"{sum(values)}/{len(values)}, {100 * found.estimate:.0f} % "
        f"({100 * found.low:.0f} to {100 * found.high:.0f})"
    )


def spread(values: Sequence[float], form: str = ".3g") -> str:
    """Returns the median and the range, as text; nothing of no values."""
    if not values:
        return ""
    middle, low, high = (format(of(values), form) for of in (median, min, max))
    return f"{middle} ({low} to {high})"
