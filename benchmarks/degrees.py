"""Accuracy of diagnosed severities and environments, from the rows of a study.

``python -m benchmarks.degrees FOLDER`` prints the tables of
``docs/results/faults-and-environments.md``;
``selfmodel ablate --damage ... --out FOLDER`` makes the rows.
"""

import argparse
import csv
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from selfmodel.experiments.confidence_intervals import proportion
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.kind import ENVIRONMENT, Fault
from selfmodel.faults.notation import parse
from selfmodel.tasks import ROBOTS

ROUGHNESSES = (0.0, 0.02, 0.04)
"""Classes of roughness, m; a severity belongs to the nearest."""


@dataclass(frozen=True)
class Found:
    """Comparison of a diagnosis with the truth.

    Attributes:
        truth: True hypothesis in notation.
        trials: Number of explained trials.
        named: Whether faults and environments are the same, at any severity.
        near: Whether, in addition, every severity is within its tolerance.
        side: Whether the diagnosis is right that robot, environment, both or nothing changed.
        verdict: Verdict of the diagnosis.
    """

    truth: str
    trials: int
    named: bool
    near: bool
    side: bool
    verdict: str


def main() -> None:
    """Prints a table per number of trials."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="of such a study")
    rows = _rows(parser.parse_args().folder)
    for trials in sorted({row.trials for row in rows}):
        same = [row for row in rows if row.trials == trials]
        print(f"After {trials} trial{'s' if trials > 1 else ''}:\n")
        print("| truth | named | and severity near | robot or world | verdicts |")
        print("|---|---|---|---|---|")
        for truth in dict.fromkeys(row.truth for row in same):
            _print_line(f"`{truth}`", [row for row in same if row.truth == truth])
        _print_line("all", same)
        print()


def compared(best: Hypothesis, truth: Hypothesis) -> tuple[bool, bool, bool]:
    """Returns ``Found.named``, ``Found.near`` and ``Found.side``."""
    found, true = _by_place(best.faults), _by_place(truth.faults)
    named = found.keys() == true.keys()
    near = named and all(_near(found[place], fault) for place, fault in true.items())
    return named, near, _sides(best) == _sides(truth)


def _rows(folder: Path) -> list[Found]:
    with (folder / "results.csv").open(encoding="utf-8", newline="") as file:
        return [_found(row) for row in csv.DictReader(file)]


def _found(row: Mapping[str, str]) -> Found:
    anatomy = ROBOTS[row["robot"]].robot().anatomy
    named, near, side = compared(parse(row["best"], anatomy), parse(row["truth"], anatomy))
    return Found(row["truth"], int(row["trials"]), named, near, side, row["verdict"])


def _by_place(faults: Iterable[Fault]) -> dict[tuple[str, str, str], Fault]:
    return {(fault.kind.keyword, fault.kind.prefix, fault.part): fault for fault in faults}


def _near(found: Fault, true: Fault) -> bool:
    if found.severity is None and true.severity is None:
        return True
    return _NEAR.get(true.kind.name, _within)(found.severity or 0.0, true.severity or 0.0)


def _within(found: float, true: float) -> bool:
    return abs(found - true) <= 0.15


_NEAR: Mapping[str, Callable[[float, float], bool]] = {
    "friction": lambda found, true: abs(found / true - 1) <= 0.15,
    "slope": lambda found, true: abs(math.degrees(found - true)) <= 1.5,
    "wind": lambda found, true: abs(found / true - 1) <= 0.2,
    "crosswind": lambda found, true: abs(found / true - 1) <= 0.2,
    "roughness": lambda found, true: _class(found) == _class(true),
}


def _class(roughness: float) -> float:
    return min(ROUGHNESSES, key=lambda level: abs(level - roughness))


def _sides(hypothesis: Hypothesis) -> set[bool]:
    return {fault.part == ENVIRONMENT for fault in hypothesis.faults}


def _print_line(name: str, rows: list[Found]) -> None:
    verdicts = [row.verdict for row in rows]
    found = ", ".join(f"{verdicts.count(one)} {one}" for one in sorted(set(verdicts)))
    parts = [
        _share([row.named for row in rows]),
        _share([row.near for row in rows]),
        _share([row.side for row in rows]),
    ]
    print(f"| {name} | {' | '.join(parts)} | {found} |")


def _share(right: list[bool]) -> str:
    interval = proportion(sum(right), len(right))
    return f"{sum(right)} of {len(right)} ({interval.low:.0%} to {interval.high:.0%})"


if __name__ == "__main__":
    main()
