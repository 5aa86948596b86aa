"""Folders of studies: cells of an ablation and of a suite, as JSON.

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
from selfmodel.experiments.grid import Cell
from selfmodel.experiments.grid.cell_file import CELL, cell_bytes
from selfmodel.experiments.grid.checks import read_study
from selfmodel.experiments.study.files import as_csv
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
    (planned,) = plan.cells(ABLATION)
    cell = dataclasses.replace(planned, needs={})  # whose cells are of the same form
    seeds = {}
    for name, row in (("ablation", ABLATION_ROW), ("suite", SUITE_ROW)):
        path = folder / name / cell.place
        path.mkdir(parents=True)
        seeds[name] = cell_bytes(path, cell, [dataclasses.asdict(row)], 1.5, {})

    def make(rng: np.random.Generator) -> Case:
        name = "ablation" if rng.random() < 0.6 else "suite"
        sealed = bool(rng.random() < 0.7)
        mutate = _sealed if sealed else jsons.mutated
        data, what = mutate(seeds[name], rng)
        check = _check_ablation if name == "ablation" else _check_suite
        files = {f"{STUDY}/{cell.place}/{CELL}": data}
        return Case(f"{name}: {what}", files, partial(check, cell, sealed=sealed))

    return make


def _sealed(data: bytes, rng: np.random.Generator) -> tuple[bytes, str]:
    """Returns a result file with another content and a right digest."""
    content = dict(verified(json.loads(data)).content)
    within = RESULT if rng.random() < 0.6 else None
    held = content if within is None else content[within]
    changed, what = jsons.mutated(json.dumps(held).encode(), rng)
    try:
        new = json.loads(changed)
        made = result_bytes(dict(new) if within is None else {**content, within: new})
    except (ValueError, TypeError, RecursionError):  # no result file has such a content
        return changed, f"without a digest: {what}"
    return made, f"sealed {what}"


def _check_ablation(cell: Cell, *, sealed: bool) -> str:
    plan.check(ABLATION)
    found = read_study(Path(STUDY))
    rows = collect(Path(STUDY))
    json.dumps(as_dict(rows, summarise(rows)), allow_nan=False)
    as_csv(AblationRow, rows)
    _check_rows(rows, (ABLATION_ROW,), sealed=sealed)
    return f"{len(rows)} rows, {len({cell.place} - found.keys())} cells left"


def _check_suite(cell: Cell, *, sealed: bool) -> str:
    assert cell.place in read_study(Path(STUDY))
    found = suite_results.write_results(Path(STUDY))
    for path in found.files:
        path.unlink()
    _check_rows(found.rows, (SUITE_ROW,), sealed=sealed)
    return f"{len(found.rows)} rows"


def _check_rows(rows: tuple[object, ...], written: tuple[object, ...], *, sealed: bool) -> None:
    """Checks that rows without the seal are those that were written."""
    if not sealed and rows != written:
        raise AssertionError("a row has changed")


TARGET = Target("study-folders", 4, prepare)
