"""The study that is measured: an ablation of the quadruped, as a command and as cells."""

import csv
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from selfmodel.experiments.ablation.plan import Ablation, cells
from selfmodel.experiments.grid import Cell
from selfmodel.settings import Settings

ROOT = Path(__file__).parents[2]
BANK = ROOT / "benchmarks" / "bank"
COMPARATORS = ("forward-displacement", "segment-prediction")
CASES = range(1, 10)
GAPS = (0.0, 0.05)


@dataclass(frozen=True)
class Size:
    """Size of the study: cases 1 to 9, two gaps, two comparators.

    Attributes:
        seeds: Seeds; each has 36 diagnoses of 18 runs.
        population: Population of the EAs.
        generations: Generations of the EAs.
        steps: Control steps of a trial.
    """

    seeds: int
    population: int
    generations: int
    steps: int


def command(size: Size, out: Path, *executor: str) -> list[str]:
    """Returns the command of the study.

    Args:
        size: Size of the study.
        out: Folder of the study.
        executor: Options of the executor.
    """
    return [
        *(sys.executable, "-m", "selfmodel", "ablate", "--robots", "quadruped", "--kinds", "paper"),
        *("--case", ",".join(map(str, CASES)), "--gap", ",".join(map(str, GAPS))),
        *("--comparator", ",".join(COMPARATORS), "--seeds", str(size.seeds)),
        *("--population", str(size.population), "--generations", str(size.generations)),
        *("--steps", str(size.steps), "--bank", str(BANK), "--out", str(out), *executor),
    ]


def start(command: list[str], stderr: Path) -> subprocess.Popen[bytes]:
    """Starts a command in a process group of its own; its standard error is added to a file."""
    with stderr.open("ab") as file:
        return subprocess.Popen(
            command,
            env={**os.environ, "PYTHONPATH": str(ROOT), "MUJOCO_GL": "disable"},
            stdout=subprocess.DEVNULL,
            stderr=file,
            start_new_session=True,
        )


def cells_of(size: Size, out: Path) -> list[Cell]:
    """Returns the cells of the study."""
    settings = Settings(steps=size.steps, generations=size.generations)
    ablation = Ablation(
        robots=["quadruped"],
        cases=list(CASES),
        comparators=COMPARATORS,
        gaps=GAPS,
        seeds=range(size.seeds),
        folder=out,
        settings=settings.scaled(size.population),
        kinds="paper",
        bank=BANK,
    )
    return cells(ablation)


def table(out: Path) -> list[dict[str, str]]:
    """Returns the table of a finished study without wall times; its numbers are exact."""
    with (out / "results.csv").open(newline="") as file:
        return [
            {name: value for name, value in row.items() if name != "seconds"}
            for row in csv.DictReader(file)
        ]
