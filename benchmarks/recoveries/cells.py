"""Cells of the study: a failure of a robot, at a level of the reality gap, with a seed."""

import itertools
import json
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.robot.robot import Robot
from selfmodel.tasks import ROBOTS


@dataclass(frozen=True)
class Cell:
    """One recovery.

    Attributes:
        robot: Name of the robot.
        case: Number of the failure in Table I.
        gap: Level of the reality gap.
        seed: Seed of the gap, and of all random choices.
    """

    robot: str
    case: int
    gap: float
    seed: int

    @property
    def nominal(self) -> Robot:
        """The robot as its model describes it."""
        return ROBOTS[self.robot].robot()

    @property
    def truth(self) -> Hypothesis:
        """Faults of the physical robot."""
        return parse(ROBOTS[self.robot].cases[self.case], self.nominal.anatomy)


def cells(
    robots: Sequence[str], cases: Sequence[int], gaps: Sequence[float], seeds: Sequence[int]
) -> list[Cell]:
    """Returns all combinations; the seeds change last, so that a part is a sample of all cases."""
    combinations = itertools.product(seeds, gaps, cases, robots)
    return [Cell(robot, case, gap, seed) for seed, gap, case, robot in combinations]


def compute(
    missing: Sequence[Cell], row_of: Callable[[Cell], dict[str, Any]], path: Path, jobs: int
) -> Iterator[dict[str, Any]]:
    """Yields the rows of the cells that a file lacks, each after it was appended to the file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    known = {_key(row) for row in read_rows(path)}
    todo = [cell for cell in missing if tuple(asdict(cell).values()) not in known]
    with ProcessPoolExecutor(jobs) as pool:
        for future in as_completed([pool.submit(row_of, cell) for cell in todo]):
            row = future.result()
            with path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row, allow_nan=False) + "\n")
            yield row


def read_rows(path: Path) -> list[dict[str, Any]]:
    """Returns the rows of a file; none if it does not exist."""
    if not path.exists():
        return []
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def _key(row: dict[str, Any]) -> tuple[Any, ...]:
    return tuple(row[name] for name in Cell.__dataclass_fields__)
