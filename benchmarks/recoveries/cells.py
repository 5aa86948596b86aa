"""Cells of the study: a failure of a robot, at a level of the reality gap, with a seed."""

import dataclasses
import itertools
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from selfmodel.experiments.grid import Cell, finished
from selfmodel.experiments.study.gaits import GAITS
from selfmodel.experiments.study.planned_robots import planned
from selfmodel.settings import Settings
from selfmodel.tasks import ROBOTS

RECOVERED = "benchmarks.recoveries.recover:recovered"
MAKE_GAIT = "benchmarks.recoveries.recover:make_gait"
"""Functions of the cells."""


def cells(
    robots: Sequence[str],
    cases: Sequence[int],
    gaps: Sequence[float],
    seeds: Sequence[int],
    *,
    repair: str,
    settings: Settings,
) -> list[Cell]:
    """Returns all combinations; the seeds change last, so that a part is a sample of all cases.

    The recoveries of a robot and seed share the gait before the failure.

    Args:
        robots: Names of robots.
        cases: Numbers of failures in Table I.
        gaps: Levels of the reality gap.
        seeds: Seeds of the gap, and of all random choices.
        repair: Name of the repair.
        settings: The paper's numbers.
    """
    common = {"repair": repair, "settings": dataclasses.asdict(settings)}
    models = {robot: planned(robot) for robot in robots}
    gaits = {
        (robot, seed): Cell(
            MAKE_GAIT, f"{robot}-seed{seed:03d}", {**models[robot], **common}, seed, repair, GAITS
        )
        for robot, seed in itertools.product(robots, seeds)
    }
    return [
        Cell(
            RECOVERED,
            f"{robot}-case{case:02d}-gap{gap:g}-seed{seed:03d}",
            {
                **models[robot],
                **common,
                "case": case,
                "truth": ROBOTS[robot].cases[case],
                "gap": gap,
            },
            seed,
            repair,
            needs={"gait": gaits[robot, seed]},
        )
        for seed, gap, case, robot in itertools.product(seeds, gaps, cases, robots)
    ]


def write_rows(folder: Path, wanted: Sequence[Cell]) -> Path:
    """Writes the rows of the finished cells of a study, ``results.jsonl``, and returns the file.

    Args:
        folder: Folder of the study. It may have cells of another repair or budget, whose rows are
            left out: only the repair is a column of a row.
        wanted: Cells of the study.
    """
    path = folder / "results.jsonl"
    places = {cell.place for cell in wanted}
    rows = (
        json.dumps(part.result, allow_nan=False)
        for part in finished(folder / "runs")
        if part.path.parent.relative_to(folder).as_posix() in places
    )
    path.write_text("".join(f"{row}\n" for row in rows), encoding="utf-8")
    return path


def read_rows(path: Path) -> list[dict[str, Any]]:
    """Returns the rows of a file."""
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
