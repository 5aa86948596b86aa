"""Folders of studies: definitions and parts of an ablation and of a suite, as JSON.

A file with another content and its old digest must be refused, or read as it was; with a right
digest it may be refused, or read.
"""

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
from selfmodel.experiments.grid import Job, PartResult, finished
from selfmodel.experiments.grid.definition import check_definition, write_definition
from selfmodel.experiments.grid.part_runner import run_part
from selfmodel.experiments.grid.parts import unfinished
from selfmodel.experiments.study_files import as_csv
from selfmodel.experiments.suite import results as suite_results
from selfmodel.experiments.suite.rows import SuiteRow
from selfmodel.logs.result_files import result_bytes, verified
from tests.fuzz.mutate import jsons
from tests.fuzz.seeds import SETTINGS
from tests.fuzz.target import Case, Make, Target

STUDY = "study"
PART = "paper-sensors"
RESULT = "result"

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
        grid = folder / name / "runs"
        write_definition(grid / job.key, job.definition)
        rows = [dataclasses.asdict(row)]
        run_part(grid, lambda *_, rows=rows: PartResult(rows), (job, PART))
        seeds[name] = {
            f"{STUDY}/{path.relative_to(folder / name).as_posix()}": path.read_bytes()
            for path in sorted((folder / name).rglob("*.json"))
        }

    def make(rng: np.random.Generator) -> Case:
        name = "ablation" if rng.random() < 0.6 else "suite"
        files = dict(seeds[name])
        chosen = str(rng.choice(sorted(files)))
        sealed = bool(rng.random() < 0.7)
        mutate = _sealed if sealed else jsons.mutated
        files[chosen], what = mutate(files[chosen], rng)
        check = _check_ablation if name == "ablation" else _check_suite
        return Case(f"{chosen}: {what}", files, partial(check, job, sealed=sealed))

    return make


def _sealed(data: bytes, rng: np.random.Generator) -> tuple[bytes, str]:
    """Returns a result file with another content and a right digest."""
    content = dict(verified(json.loads(data)).content)
    within = RESULT if RESULT in content and rng.random() < 0.6 else None
    held = content if within is None else content[within]
    changed, what = jsons.mutated(json.dumps(held).encode(), rng)
    try:
        new = json.loads(changed)
        made = result_bytes(dict(new) if within is None else {**content, within: new})
    except (ValueError, TypeError, RecursionError):  # no result file has such a content
        return changed, f"without a digest: {what}"
    return made, f"sealed {what}"


def _check_ablation(job: Job, *, sealed: bool) -> str:
    plan.check(ABLATION)
    run = Path(STUDY) / "runs" / job.key
    check_definition(run, job.definition)
    left = unfinished(run, job.definition, [PART])
    rows = collect(Path(STUDY))
    json.dumps(as_dict(rows, summarise(rows)), allow_nan=False)
    as_csv(AblationRow, rows)
    _check_rows(rows, (ABLATION_ROW,), sealed=sealed)
    return f"{len(rows)} rows, {len(left)} parts left"


def _check_suite(job: Job, *, sealed: bool) -> str:
    unfinished(Path(STUDY) / "runs" / job.key, job.definition, [PART])
    found = suite_results.write_results(Path(STUDY))
    for path in found.files:
        path.unlink()
    _check_rows(found.rows, (SUITE_ROW,), sealed=sealed)
    return f"{len(found.rows)} rows"


def _check_rows(rows: tuple[object, ...], written: tuple[object, ...], *, sealed: bool) -> None:
    """Checks that rows without the seal are those that were written, but for files of 0.1."""
    verified_parts = all(part.made_with is not None for part in finished(Path(STUDY) / "runs"))
    if not sealed and verified_parts and rows != written:
        raise AssertionError("a row has changed")


TARGET = Target("study-folders", 4, prepare)
