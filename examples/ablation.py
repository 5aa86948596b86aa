"""An ablation through the Python API: the rate of right diagnoses per comparator.

Usage: python examples/ablation.py FOLDER
"""

import sys
from pathlib import Path

from selfmodel.settings import Settings
from selfmodel.studies import ablation
from selfmodel.studies.tables import ablation_results, write_files


def main(folder: Path) -> None:
    """Runs a small grid; a second call with the same folder continues an interrupted grid."""
    study = ablation(
        folder,
        robots=["quadruped"],
        cases=[1, 9],
        comparators=["forward-displacement"],  # or your own, as package.module:object
        gaps=[0.0],
        seeds=2,
        settings=Settings(steps=60, generations=2, trials=1).scaled(8),
    )
    failed = study.run(workers=2, on_event=print)
    found = ablation_results(folder)
    for score in found.facts["scores"]:
        name, trials = score["comparator"], score["trials"]
        print(f"{name}, {trials} trials: {score['right']} of {score['runs']} right")
    table, *_ = write_files(folder, found.files)
    print(f"{len(found.facts['rows'])} rows, {len(failed)} failed: {table}")


if __name__ == "__main__":  # the grid's processes import this file
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(Path(sys.argv[1]))
