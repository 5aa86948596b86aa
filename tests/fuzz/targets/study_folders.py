"""Folders of studies: definitions and parts of an ablation and of a suite, as JSON."""

import dataclasses
import json
from functools import partial
from pathlib import Path

import numpy as np

from selfmodel.experiments.ablation import plan
from selfmodel.experiments.ablation.plan import Ablation
from selfmodel.experiments.ablation.results import as_dict, collect
from selfmodel.experiments.ablation.rows import AblationRow
from selfmodel.experiments.ablation.scores import summarise
from selfmodel.experiments.grid import Job
from selfmodel.experiments.grid.folder import (
    check_definition,
    is_finished,
    write_definition,
    write_part,
)
from selfmodel.experiments.study_files import as_csv
from selfmodel.experiments.suite import results as suite_results
from selfmodel.experiments.suite.rows import SuiteRow
from tests.fuzz.mutate import jsons
from tests.fuzz.seeds import SETTINGS
from tests.fuzz.target import Case, Make, Target

STUDY = "study"
PART = "paper-sensors"

ABLATION = Ablation(
    robots=("quadruped",),
    cases=(1,),
    comparators=(PART,),
    gaps=(0.0,),
    seeds=(0,),
    folder=Path(STUDY),
    settings=SETTINGS,
)
ABLATION_ROW = AblationRow(
    *("quadruped", 1, "break:front_left_knee", 0.0, 0, "bank", PART, 1, "break:front_left_knee"),
    *(True, 0.25, 0.5, "explained", 0, 8, 7, 1.5, 1.0, 0.5, 0.75),
)
SUITE_ROW = SuiteRow(
    *("quadruped", 1, "break:front_left_knee", 0, "intact", False, "ambiguous", 1, 1.0, 0.5, 0.75),
    *(0, 2.5),
)


def prepare(folder: Path) -> Make:
    """Returns the maker of folders."""
    (cell,) = plan.cells(ABLATION)
    job = plan.job(ABLATION, cell, ["0" * 64])
    seeds = {}
    for name, row in (("ablation", ABLATION_ROW), ("suite", SUITE_ROW)):
        run = folder / name / "runs" / job.key
        write_definition(run, job.definition)
        write_part(run, PART, {"status": "done", "result": [dataclasses.asdict(row)], "seconds": 1})
        files = {
            f"{STUDY}/{path.relative_to(folder / name).as_posix()}": path.read_bytes()
            for path in sorted((folder / name).rglob("*.json"))
        }
        seeds[name] = files

    def make(rng: np.random.Generator) -> Case:
        name = "ablation" if rng.random() < 0.6 else "suite"
        files = dict(seeds[name])
        chosen = str(rng.choice(sorted(files)))
        files[chosen], what = jsons.mutated(files[chosen], rng)
        check = _check_ablation if name == "ablation" else _check_suite
        return Case(f"{chosen}: {what}", files, partial(check, job))

    return make


def _check_ablation(job: Job) -> str:
    plan.check(ABLATION)
    run = Path(STUDY) / "runs" / job.key
    check_definition(run, job.definition)
    finished = is_finished(run, PART)
    rows = collect(Path(STUDY))
    json.dumps(as_dict(rows, summarise(rows)), allow_nan=False)
    as_csv(AblationRow, rows)
    return f"{len(rows)} rows, {'finished' if finished else 'unfinished'}"


def _check_suite(job: Job) -> str:
    run = Path(STUDY) / "runs" / job.key
    is_finished(run, PART)
    found = suite_results.write_results(Path(STUDY))
    for path in found.files:
        path.unlink()
    return f"{len(found.rows)} rows"


TARGET = Target("study-folders", 4, prepare)
