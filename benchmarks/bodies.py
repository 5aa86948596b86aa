"""How bodies recover, from the rows of studies that ``selfmodel suite run`` made.

``python -m benchmarks.bodies FOLDER...`` prints the tables that ``docs/robots.md`` has, and draws
``docs/figures/bodies.png``.
"""

import csv
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import matplotlib as mpl

mpl.use("Agg")  # a figure in a file needs no display

from matplotlib import pyplot as plt

FIGURE = Path("docs/figures/bodies.png")
CASES = ("1", "2", "3", "5", "6")
"""The cases that are one fault."""

SCORES = ("before", "after", "recovered")


@dataclass(frozen=True)
class Recovery:
    """One recovery from a single fault.

    Attributes:
        body: The robot.
        case: Which failure.
        correct: Whether the last diagnosis is right.
        before: Score before the failure.
        after: Score of the same controller after it.
        recovered: Score of the best recovery trial.
    """

    body: str
    case: str
    correct: bool
    before: float
    after: float
    recovered: float

    @property
    def part(self) -> float:
        """What is recovered of the score before the failure."""
        return self.recovered / self.before


def main() -> None:
    """Prints the tables and draws the figure."""
    rows = [row for folder in sys.argv[1:] for row in _rows(Path(folder))]
    bodies = sorted({row.body for row in rows})
    print("| body | before | after | recovered | recovered ÷ before | right |")
    print("|---|---:|---:|---:|---:|---:|")
    for body in bodies:
        own = [row for row in rows if row.body == body]
        scores = (median(getattr(row, name) for row in own) for name in SCORES)
        told = " | ".join(f"{score:.2f}" for score in scores)
        print(f"| `{body}` | {told} | {median(r.part for r in own):.2f} | {_right(own)} |")
    print(f"| all | | | | {median(r.part for r in rows):.2f} | {_right(rows)} |\n")
    print(f"| body | {' | '.join(f'case {case}' for case in CASES)} |")
    print(f"|---|{'---:|' * len(CASES)}")
    for body in bodies:
        of_case = [[r.part for r in rows if (r.body, r.case) == (body, case)] for case in CASES]
        told = " | ".join(f"{median(parts):.2f}" if parts else "" for parts in of_case)
        print(f"| `{body}` | {told} |")
    _draw(rows, bodies)


def _rows(folder: Path) -> list[Recovery]:
    with (folder / "results.csv").open(encoding="utf-8", newline="") as file:
        return [
            Recovery(
                row["robot"],
                row["case"],
                row["correct"] == "true",
                *(float(row[name]) for name in SCORES),
            )
            for row in csv.DictReader(file)
            if row["case"] in CASES
        ]


def _right(rows: Sequence[Recovery]) -> str:
    return f"{sum(row.correct for row in rows)} of {len(rows)}"


def _draw(rows: Sequence[Recovery], bodies: Sequence[str]) -> None:
    figure, axes = plt.subplots(figsize=(8, 0.4 * len(bodies) + 1.2), layout="constrained")
    for y, body in enumerate(reversed(bodies)):
        own = [row for row in rows if row.body == body]
        for shift, name, colour in ((0.15, "after", "tab:red"), (-0.15, "recovered", "tab:blue")):
            parts = [getattr(row, name) / row.before for row in own]
            heights = [y + shift] * len(parts)
            axes.plot(parts, heights, ".", color=colour, alpha=0.4, markersize=5)
            label = f"{name} (median)" if y == 0 else None
            axes.plot(median(parts), y + shift, "|", color=colour, markersize=12, label=label)
    axes.axvline(1, color="grey", linewidth=0.8)
    axes.axvline(0.8, color="grey", linewidth=0.8, linestyle=":")
    axes.set_yticks(range(len(bodies)), reversed(bodies))
    axes.set_xlabel("score as a part of that before the failure; one fault each")
    axes.set_xlim(-0.6, 3)
    figure.legend(frameon=False, loc="outside upper center", ncols=2)
    axes.spines[["top", "right"]].set_visible(False)
    FIGURE.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(FIGURE, dpi=150)


if __name__ == "__main__":
    main()
