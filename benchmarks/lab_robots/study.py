"""Recoveries of the robots that laboratories have, seed by seed, at no gap and at a gap of 5 %.

``python -m benchmarks.lab_robots.study WHEELS OUT`` runs the study; the same command continues an
interrupted one. A stop at any time leaves a balanced table: a seed of all models at both gaps comes
before the next seed.
"""

import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.lab_robots.models import write_models

GAPS = (0.0, 0.05)
SEEDS = 3
CASES = (1, 2, 3, 5, 6, 7)
"""The single faults of Table I, and a compound of two."""

BUDGET = ("--steps", "200", "--population", "50", "--generations", "12")
DESIGN = ("--controller", "cpg", "--score", "upright")


def main() -> None:
    """Runs the study."""
    wheels, out = Path(sys.argv[1]), Path(sys.argv[2])
    models = list(write_models(wheels, out / "models").values())
    for seed in range(SEEDS):
        for gap in GAPS:
            _copy_gaits(out, gap)
            _run(models, seed, gap, folder_of(out, gap))


def folder_of(out: Path, gap: float) -> Path:
    """Returns the folder of the recoveries at a level of the reality gap."""
    return out / f"gap{gap:g}"


def _run(models: Sequence[Path], seed: int, gap: float, folder: Path) -> None:
    """Runs the recoveries of one seed at one gap; a failed run is in the table of the command."""
    what = ("--domains", ",".join(map(str, models)), "--case", ",".join(map(str, CASES)))
    where = ("--seed", str(seed), "--gap", str(gap), "--out", str(folder))
    command = (sys.executable, "-m", "selfmodel", "suite", "run", *what, *DESIGN, *BUDGET, *where)
    subprocess.run(command, check=False)  # noqa: S603  # arguments of this file


def _copy_gaits(out: Path, gap: float) -> None:
    """Copies the evolved gaits of the first gap, which do not depend on the gap."""
    source = folder_of(out, GAPS[0]) / "gaits"
    if gap != GAPS[0]:
        shutil.copytree(source, folder_of(out, gap) / "gaits", dirs_exist_ok=True)


if __name__ == "__main__":
    main()
