"""Row of one recovery."""

import math
import tempfile
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.recoveries.cells import Cell
from selfmodel.experiments.arguments import AUTO, comparator_choice
from selfmodel.experiments.experiment import Experiment, run
from selfmodel.experiments.plugins import DEFAULT_SCORES
from selfmodel.recovery.scores.fitness import DISPLACEMENT
from selfmodel.recovery.scores.upright import UPRIGHT
from selfmodel.settings import Settings


def recovered(cell: Cell, *, repair: str, settings: Settings) -> dict[str, Any]:
    """Returns the row of a recovery: diagnosis, predicted and observed upright displacement, m.

    Args:
        cell: The failure.
        repair: Name of the repair.
        settings: The paper's numbers.
    """
    scores = {score.name: score for score in (UPRIGHT, DISPLACEMENT)}
    with tempfile.TemporaryDirectory() as folder:
        experiment = Experiment(
            robot=cell.nominal,
            case=cell.case,
            truth=cell.truth,
            choose_comparator=comparator_choice(AUTO),
            settings=settings,
            seed=cell.seed,
            threads=1,
            folder=Path(folder) / "run",
            gap=cell.gap,
            score=scores[DEFAULT_SCORES[repair]],
            repair=repair,
        )
        outcome = run(experiment, lambda _event: None)
        recovery = outcome.recovery
        upright = [
            UPRIGHT.of_trial(cell.nominal, faults, trial)
            for faults, trial in zip(recovery.tried, recovery.trials, strict=True)
        ]
    number = partial(round, ndigits=4)
    return {
        **asdict(cell),
        "repair": repair,
        "correct": outcome.correct,
        "diagnosis": str(recovery.diagnosis.best),
        "verdict": recovery.diagnosis.verdict,
        "predicted": [
            number(value) if math.isfinite(value) else None for value in recovery.predicted
        ],
        "upright": [number(value) for value in upright],
        "displacement": [number(trial.displacement) for trial in recovery.trials],
        "falls": list(recovery.falls),
        "simulated_steps": outcome.stats.steps,
        "seconds": number(outcome.seconds),
    }
