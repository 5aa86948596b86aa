"""Recoveries of the robots that laboratories have, seed by seed, at no gap and at a gap of 5 %.

``python -m benchmarks.lab_robots.study WHEELS OUT`` runs the study; the same command continues an
interrupted one. A stop at any time leaves a balanced table: a seed of all models at both gaps comes
before the next seed.
"""

import argparse
import shutil
import subprocess
import sys
from collections.abc import Sequence
from itertools import product
from pathlib import Path

from benchmarks.lab_robots.models import write_models

GAPS = (0.0, 0.05)
SEEDS = 3
ROBOTS = ("go2", "a2", "aliengo", "mini_cheetah", "hyqreal2", "pegasus", "mjx_go1", "mjx_spot")
"""Robots that fail and recover; a run of another model takes more than a minute."""

CASES = ((1, 7), (6,), (2,), (5,), (3,))
"""Numbers of failures: all seeds and gaps of the first before those of the next. A broken knee, and
a lost leg with a jammed hip; a jammed hip; a lost leg; then dead sensors, which cost a CPG
little."""

BUDGET = ("--steps", "200", "--population", "50", "--generations", "12")
DESIGN = ("--controller", "cpg", "--score", "upright")


def main() -> None:
    """Runs the study."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("wheels", type=Path, help="folder of the unpacked wheels")
    parser.add_argument("out", type=Path, help="folder of the study")
    options = parser.parse_args()
    wheels, out = options.wheels, options.out
    models = write_models(wheels, out / "models")
    for cases, seed, gap in product(CASES, range(SEEDS), GAPS):
        _copy_gaits(out, gap)
        _run([models[name] for name in ROBOTS], cases, seed, gap, folder_of(out, gap))


def folder_of(out: Path, gap: float) -> Path:
    """Returns the folder of the recoveries at a level of the reality gap."""
    return out / f"gap{gap:g}"


def _run(models: Sequence[Path], cases: Sequence[int], seed: int, gap: float, folder: Path) -> None:
    """Runs the recoveries of one seed at one gap; a failed run is in the table of the command."""
    what = ("--domains", ",".join(map(str, models)), "--case", ",".join(map(str, cases)))
    where = ("--seed", str(seed), "--gap", str(gap), "--out", str(folder))
    command = (sys.executable, "-m", "selfmodel", "suite", "run", *what, *DESIGN, *BUDGET, *where)
    subprocess.run(command, check=False)


def _copy_gaits(out: Path, gap: float) -> None:
    """Copies the evolved gaits of the first gap, which do not depend on the gap."""
    source = folder_of(out, GAPS[0]) / "gaits"
    if gap != GAPS[0]:
        shutil.copytree(source, folder_of(out, gap) / "gaits", dirs_exist_ok=True)


if __name__ == "__main__":
    main()
