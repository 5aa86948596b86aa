"""An ablation through the Python API: the rate of right diagnoses per comparator.

Usage: python examples/ablation.py FOLDER
"""

import sys
from pathlib import Path

from selfmodel.experiments import processes
from selfmodel.experiments.ablation import Ablation, ablate, write_results
from selfmodel.settings import Settings


def main(folder: Path) -> None:
    """Runs a small grid; a second call with the same folder continues an interrupted grid."""
    ablation = Ablation(
        robots=["quadruped"],
        cases=[1, 9],
        comparators=["forward-displacement"],  # or your own, as package.module:object
        gaps=[0.0],
        seeds=range(2),
        folder=folder,
        settings=Settings(steps=200, generations=3).scaled(10),
    )
    failed = ablate(ablation, workers=processes(2), on_progress=print)
    results = write_results(folder)
    for score in results.scores:
        print(f"{score.comparator}, {score.trials} trials: {score.right} of {score.runs} right")
    print(f"{len(results.rows)} rows, {len(failed)} failed: {results.files[0]}")


if __name__ == "__main__":  # the grid's processes import this file
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(Path(sys.argv[1]))
