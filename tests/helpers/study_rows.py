"""Rows of studies, made up."""

from collections.abc import Sequence
from typing import Any

from selfmodel.studies.rows import KINDS

Row = dict[str, Any]

RUN: Row = {"robot": "quadruped", "case": 1, "truth": "break:front_left_knee", "seed": 0}
FOUND: Row = {"correct": True, "verdict": "explained", "repair": "paper", "search": "ea"}


def diagnosis(comparator: str = "a", **changes: object) -> Row:
    """A right diagnosis of case 1 of the quadruped."""
    usual = {
        **RUN,
        **FOUND,
        "gap": 0.05,
        "next_trial": "bank",
        "trials": 1,
        "best": "intact",
        "rivals": 0,
        "seconds": 1.0,
    }
    row = dict.fromkeys(KINDS["ablate"].columns) | usual | {"comparator": comparator}
    return row | changes


def body(seed: int = 0, **changes: object) -> Row:
    """A right recovery of a study of bodies."""
    usual = {
        **FOUND,
        "robot": "a",
        "case": 1,
        "truth": "break:x",
        "best": "break:x",
        "seed": seed,
        "trials": 2,
        "before": 2.0,
        "after": 0.0,
        "best_trial": 1.0,
        "diverged": 0,
        "seconds": 3.0,
        "regained": 0.5,
        "outcome": "better",
        "upright_best_trial": True,
    }
    return dict.fromkeys(KINDS["suite"].columns) | usual | changes


def recovery(**changes: object) -> Row:
    """A recovery of the paper's experiment; wrong ones are diagnosed as intact."""
    usual = {
        **RUN,
        "comparator": "a",
        "compared_by": "a",
        "correct": True,
        "before": 2.0,
        "after": 0.5,
        "recovered": 2.0,
        "distinct_hypotheses": 50,
        "diverged": 0,
        "seconds": 3.0,
    }
    row = usual | changes
    return {**row, "best": row["truth"] if row["correct"] else "intact"}


def trials(displacements: Sequence[float], **changes: object) -> list[Row]:
    """The trials of one recovery: before, after, then those of the recovery."""
    stages = ["before", "after", *["recovery"] * (len(displacements) - 2)]
    run = {"robot": "quadruped", "case": 1, "seed": 0, "comparator": "a", "hypothesis": "intact"}
    return [
        {**run, "number": number, "stage": stage, "displacement": displacement, **changes}
        for number, (stage, displacement) in enumerate(zip(stages, displacements, strict=True))
    ]


def evolution(bests: Sequence[float], **changes: object) -> list[Row]:
    """An evolution on the robot, 10 evaluations a generation; 2 m before the failure."""
    run = {"robot": "quadruped", "case": 1, "seed": 0, "before": 2.0}
    return [
        {**run, "evaluations": 10 * number, "best": best, **changes}
        for number, best in enumerate(bests, start=1)
    ]


def rival(method: str, upright: Sequence[float], **changes: object) -> Row:
    """A method on a damaged physical robot."""
    best = [max(upright[: count + 1]) for count in range(len(upright))]
    usual = {
        **RUN,
        "method": method,
        "gap": 0.1,
        "best": best,
        "upright": list(upright),
        "displacement": list(upright),
        "fallen": [False] * len(upright),
        "steps": [10] * len(upright),
        "simulated_steps": 0,
        "seconds": 1.0,
    }
    return usual | changes
