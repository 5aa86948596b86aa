"""Tables of the study of robots that laboratories have.

``python -m benchmarks.lab_robots.table OUT`` prints the tables of ``docs/results/robots.md`` of a
finished study, and writes its rows into ``docs/lab-robots.csv``; ``python -m
benchmarks.lab_robots.table`` prints the tables of the rows in that file.
"""

import argparse
import csv
import json
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.lab_robots.models import MODELS
from benchmarks.lab_robots.study import GAPS, folder_of
from selfmodel.experiments.confidence_intervals import proportion
from selfmodel.experiments.grid import finished

ROWS = Path("docs/lab-robots.csv")


@dataclass(frozen=True)
class Row:
    """One recovery of the study.

    Attributes:
        robot: Name of the model.
        gap: Level of the reality gap.
        case: Number of the failure.
        truth: The failure, in notation.
        seed: Seed of the run.
        best: Best hypothesis of the last diagnosis, in notation.
        correct: Whether the best hypothesis is the truth, or behaves like the truth in all trials.
        verdict: Verdict of the last diagnosis.
        before: Displacement up to a fall before the failure, m.
        after: The same after the failure, m.
        recovered: The same in the best recovery trial, m.
        upright: Whether the robot did not fall in the best recovery trial.
        seconds: Wall time, s.
        difference: Largest difference of simulated and physical displacement in the trials of the
            run, m; None at a gap.
    """

    robot: str
    gap: float
    case: int
    truth: str
    seed: int
    best: str
    correct: bool
    verdict: str
    before: float
    after: float
    recovered: float
    upright: bool
    seconds: float
    difference: float | None

    @property
    def recovery(self) -> float:
        """Recovered over before."""
        return self.recovered / self.before


def main() -> None:
    """Prints the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "out",
        type=Path,
        nargs="?",
        help="folder of the study; without it, the rows in docs/lab-robots.csv are printed",
    )
    out = parser.parse_args().out
    if out is not None:
        _write(_collected(out))
    rows = _read()
    _print_robots(rows)
    print()
    _print_cases(rows)


def _collected(out: Path) -> list[Row]:
    """Returns the rows of the finished recoveries, and prints the failed ones."""
    exact = json.loads((out / "exactness.json").read_text(encoding="utf-8"))
    rows = []
    names = [field.name for field in fields(Row)]
    for gap in GAPS:
        for error in sorted(folder_of(out, gap).glob("errors/*.txt")):
            print(f"failed: {error.stem} at {gap:g}: {error.read_text()}", file=sys.stderr)
        for part in finished(folder_of(out, gap) / "runs"):
            difference = exact[part.key] if gap == 0 else None
            values = {**part.result[0], "gap": gap, "difference": difference}
            rows.append(Row(**{name: values[name] for name in names}))
    order = list(MODELS)
    return sorted(rows, key=lambda row: (order.index(row.robot), row.gap, row.case, row.seed))


def _write(rows: Sequence[Row]) -> None:
    with ROWS.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(Row)], lineterminator="\n")
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)


def _read() -> list[Row]:
    with ROWS.open(newline="", encoding="utf-8") as file:
        return [_row(values) for values in csv.DictReader(file)]


def _row(values: Mapping[str, str]) -> Row:
    parsers: Mapping[object, Callable[[str], Any]] = {
        str: str,
        int: int,
        float: float,
        bool: lambda text: text == "True",
        float | None: lambda text: float(text) if text else None,
    }
    return Row(**{field.name: parsers[field.type](values[field.name]) for field in fields(Row)})


def _print_robots(rows: Sequence[Row]) -> None:
    print(
        "| robot | gap | before, m | after, m | recovered, m | recovered ÷ before | upright "
        "| right | 95 % interval, % | largest difference, m | s per run |"
    )
    print("|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|")
    for robot in dict.fromkeys(row.robot for row in rows):
        for gap in GAPS:
            _print_line(f"`{robot}`", gap, [r for r in rows if (r.robot, r.gap) == (robot, gap)])
    for gap in GAPS:
        _print_line("all", gap, [row for row in rows if row.gap == gap])


def _print_line(name: str, gap: float, rows: Sequence[Row]) -> None:
    if not rows:
        return
    right = sum(row.correct for row in rows)
    share = proportion(right, len(rows))
    upright = sum(row.upright for row in rows)
    differences = [row.difference for row in rows if row.difference is not None]
    cells = [
        name,
        f"{gap:g}",
        *(f"{median(values):.2f}" for values in _scores(rows)),
        f"{upright} of {len(rows)}",
        f"{right} of {len(rows)}",
        f"{100 * share.low:.0f} to {100 * share.high:.0f}",
        f"{max(differences):.1g}" if differences else "",
        f"{median(row.seconds for row in rows):.0f}",
    ]
    print(f"| {' | '.join(cells)} |")


def _scores(rows: Sequence[Row]) -> Iterable[list[float]]:
    for name in ("before", "after", "recovered", "recovery"):
        yield [getattr(row, name) for row in rows]


def _print_cases(rows: Sequence[Row]) -> None:
    print("| case | gap | recovered ÷ before | upright | right |")
    print("|---:|---:|---:|---:|---:|")
    for case in sorted({row.case for row in rows}):
        for gap in GAPS:
            own = [row for row in rows if (row.case, row.gap) == (case, gap)]
            if not own:
                continue
            counts = (sum(row.upright for row in own), sum(row.correct for row in own))
            texts = [f"{count} of {len(own)}" for count in counts]
            ratio = f"{median(row.recovery for row in own):.2f}"
            print(f"| {case} | {gap:g} | {ratio} | {' | '.join(texts)} |")


if __name__ == "__main__":
    main()
