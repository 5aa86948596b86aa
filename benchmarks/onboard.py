"""Diagnoses without base position and linear velocity, from the logs of a study.

``python -m benchmarks.onboard FOLDER --out OUT`` removes the base's position and linear
velocity from all trials of the study in ``FOLDER``, healthy ones included, calibrates and diagnoses
from the rest, and writes ``OUT/results.csv`` and the other files of a study. Called again, it
resumes. In the study itself every comparator has the same calibrated self-model, fitted to all
signals of the healthy robot.
"""

import argparse
import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from selfmodel.experiments.ablation.results import write_results
from selfmodel.experiments.ablation.run_one import diagnose_run
from selfmodel.experiments.ablation.scores import ComparatorScore
from selfmodel.experiments.ablation.trials import read_trials, setting_of
from selfmodel.experiments.grid import (
    Cell,
    GridBegins,
    PartEnds,
    finished,
    processes,
    run_grid,
)
from selfmodel.experiments.study.files import as_dicts
from selfmodel.simulation.calibration import calibrate
from selfmodel.trials.estimation import BASE
from selfmodel.trials.trial import Trial

COMPARATOR = "segment-prediction-onboard"


def main() -> None:
    """Diagnoses, prints a table and writes the rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="of an ablation that has run")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--robots", default="quadruped,hexapod")
    parser.add_argument("--seeds", type=int, default=4, help="the runs of the seeds below this")
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    cells = [
        Cell(
            "benchmarks.onboard:diagnoses",
            run.key,
            {**run.parameters, "trials": str(run.path.parent.resolve())},
            run.seed,
            COMPARATOR,
        )
        for run in finished(options.folder / "trials")
        if run.seed < options.seeds and run.parameters["robot"] in options.robots.split(",")
    ]
    if not cells:
        raise SystemExit(f"{options.folder} has no run of an ablation with these robots and seeds")
    workers = processes(options.workers)
    failed = run_grid(options.out, cells, workers=workers, on_progress=_print_progress)
    print(table(write_results(options.out).scores))
    if failed:
        raise SystemExit("\n".join(f"{part.key} failed: {part.error}" for part in failed))


def without_base(trial: Trial) -> Trial:
    """Returns the trial without the base's position and linear velocity."""
    run = trial.behaviour
    forgotten = {signal: np.full_like(run[signal], np.nan) for signal in BASE}
    behaviour = dataclasses.replace(run, signals={**run.signals, **forgotten})
    return dataclasses.replace(trial, behaviour=behaviour)


def table(scores: Sequence[ComparatorScore]) -> str:
    """Returns the number of right diagnoses as Markdown."""
    gaps = sorted({score.gap for score in scores})
    lines = [
        f"| robot | trials | {' | '.join(f'gap {gap:g}' for gap in gaps)} |",
        f"|---|---|{'---|' * len(gaps)}",
    ]
    for robot, trials in sorted({(score.robot, score.trials) for score in scores}):
        shares = {
            score.gap: f"{score.right} of {score.runs} "
            f"({score.correct.low:.0%} to {score.correct.high:.0%})"
            for score in scores
            if (score.robot, score.trials) == (robot, trials)
        }
        cells = [shares.get(gap, "-") for gap in gaps]
        lines.append(f"| {robot} | {trials} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _print_progress(event: GridBegins | PartEnds) -> None:
    if isinstance(event, PartEnds):
        print(f"{event.number} of {event.total}: {event.key}, {event.seconds:.0f} s", flush=True)


def diagnoses(cell: Cell, _needs: Mapping[str, Path], _folder: Path) -> list[dict[str, Any]]:
    """Returns the rows of the diagnoses of a run."""
    setting = setting_of(cell)
    healthy, failed = (
        [without_base(trial) for trial in trials]
        for trials in read_trials(Path(cell.parameters["trials"]))
    )
    fitted = calibrate(setting.robot, healthy, threads=1).robot
    return as_dicts(diagnose_run(setting, cell.part, fitted, healthy, failed))


if __name__ == "__main__":
    main()
