"""The study: a failure of a robot, at a level of the reality gap, with a seed."""

import dataclasses
import itertools
import json
import math
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from selfmodel.arguments import AUTO, comparator_choice
from selfmodel.faults.notation import parse
from selfmodel.recovery.scores import DISPLACEMENT, UPRIGHT
from selfmodel.settings import Settings
from selfmodel.studies import recoveries
from selfmodel.studies.experiment import Experiment, run
from selfmodel.studies.study import Study
from selfmodel.tasks import ROBOTS

SCORES = {score.name: score for score in (UPRIGHT, DISPLACEMENT)}


def study(
    folder: Path,
    robots: Sequence[str],
    cases: Sequence[int],
    gaps: Sequence[float],
    seeds: Sequence[int],
    *,
    repair: str,
    settings: Settings,
) -> Study:
    """Returns all combinations; the seeds change last, so that a part is a sample of all cases.

    The recoveries of a robot and seed share the gait before the failure.

    Args:
        folder: Folder of the study.
        robots: Names of robots.
        cases: Numbers of failures in Table I.
        gaps: Levels of the reality gap.
        seeds: Seeds of the gap, and of all random choices.
        repair: Name of the repair.
        settings: The paper's numbers.
    """
    chosen = recoveries.repair_parameters(repair, None, None)
    models = {robot: recoveries.planned(robot) for robot in robots}
    gaits = {
        (robot, seed): recoveries.gait_cell(models[robot], settings, seed, chosen)
        for robot, seed in itertools.product(robots, seeds)
    }
    points = {
        f"{robot}-case{case:02d}-gap{gap:g}-seed{seed:03d}": {
            **models[robot],
            "case": case,
            "truth": ROBOTS[robot].cases[case],
            "gap": gap,
            "seed": seed,
        }
        for seed, gap, case, robot in itertools.product(seeds, gaps, cases, robots)
    }
    return Study(
        "recoveries",
        folder,
        f"{__name__}:recovered",
        points,
        {**chosen, "settings": dataclasses.asdict(settings)},
        lambda point: {"gait": gaits[point["robot"], point["seed"]]},
    )


def write_rows(wanted: Study) -> Path:
    """Writes the rows of the finished runs of a study, ``results.jsonl``, and returns the file."""
    path = wanted.folder / "results.jsonl"
    rows = (json.dumps(row, allow_nan=False) for row in wanted.rows())
    path.write_text("".join(f"{row}\n" for row in rows), encoding="utf-8")
    return path


def read_rows(path: Path) -> list[dict[str, Any]]:
    """Returns the rows of a file."""
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def recovered(
    parameters: Mapping[str, Any], needs: Mapping[str, Path], folder: Path
) -> dict[str, Any]:
    """Returns the row of a recovery: diagnosis, predicted and observed upright displacement, m.

    Steps and seconds are without the search for the gait before the failure, which the recoveries
    of a robot and seed share.
    """
    shared = parameters["shared"]
    robot = recoveries.planned_entry(parameters).robot()
    experiment = Experiment(
        robot=robot,
        case=parameters["case"],
        truth=parse(parameters["truth"], robot.anatomy),
        choose_comparator=comparator_choice(AUTO),
        settings=Settings(**shared["settings"]),
        seed=parameters["seed"],
        threads=1,
        folder=folder / "recovery",
        gap=parameters["gap"],
        score=SCORES[shared["score"]],
        repair=shared["repair"],
        gait=recoveries.read_gait(needs["gait"], robot),
    )
    outcome = run(experiment, lambda _event: None)
    recovery = outcome.recovery
    upright = [
        UPRIGHT.of_trial(robot, faults, trial)
        for faults, trial in zip(recovery.tried, recovery.trials, strict=True)
    ]
    number = partial(round, ndigits=4)
    return {
        "repair": shared["repair"],
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
