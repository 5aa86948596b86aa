"""Promises of the results: everything in the folder, the paper's comparator first."""

import csv
import json
from dataclasses import asdict
from itertools import product
from pathlib import Path
from typing import Any

from selfmodel.experiments.grid import Cell
from selfmodel.experiments.grid.cell_file import CELL, cell_bytes
from selfmodel.experiments.paper.plan import ON_ROBOT
from selfmodel.experiments.paper.results import collect, write_results
from selfmodel.experiments.study.files import as_dicts
from selfmodel.settings import Settings
from tests.helpers.paper_rows import evolution, recovery, trials


def rows_of(part: str, run: dict[str, Any]) -> dict[str, Any]:
    """The result of a part of a made-up run."""
    if part == ON_ROBOT:
        return {"evolution": as_dicts(evolution([0.5, 1.0], **run))}
    row = recovery(comparator=part, **run)
    rows = trials([2.0, 0.5, 2.0], comparator=part, **run)
    return {"recoveries": as_dicts([row]), "trials": as_dicts(rows)}


def made(folder: Path, *parts: str) -> Path:
    """Makes a folder with made-up runs of both robots."""
    shared = {"shared": {"settings": asdict(Settings())}}
    for robot, case in product(("hexapod", "quadruped"), (10, 2)):
        parameters = {"robot": robot, "case": case, **shared}
        for part in parts:
            cell = Cell("made:up", f"{robot}-case{case:02d}-seed000", parameters, 0, part)
            rows = rows_of(part, {"robot": robot, "case": case, "seed": 0})
            (folder / cell.place).mkdir(parents=True)
            data = cell_bytes(folder / cell.place, cell, rows, 1.0, {})
            (folder / cell.place / CELL).write_bytes(data)
    return folder


def test_the_results_are_in_the_papers_order_and_in_files(tmp_path: Path):
    found = write_results(made(tmp_path, "auto", "forward-displacement", ON_ROBOT))

    order = [(row.robot, row.case, row.comparator) for row in found.recoveries]
    assert order == [
        (robot, case, comparator)
        for robot in ("quadruped", "hexapod")
        for case in (2, 10)
        for comparator in ("forward-displacement", "auto")
    ]
    assert found.settings == Settings()
    names = {path.name for path in found.files}
    assert names >= {f"figure-{n}.{end}" for n in (1, 5, 6) for end in ("png", "pdf")}
    assert names >= {"paper.md", "results.json", "table-1.csv", "table-2.csv", "evolution.csv"}
    with (tmp_path / "trials.csv").open(newline="") as file:
        assert len(list(csv.DictReader(file))) == len(found.trials) == 24
    written = json.loads((tmp_path / "results.json").read_text())
    assert len(written["table_2"]) == 8
    assert written["costs"][0]["recovery"] == 1.0


def test_a_folder_without_the_control_has_the_other_results(tmp_path: Path):
    found = collect(made(tmp_path, "auto"))

    assert found.evolution == ()
    assert {cost.way for cost in found.costs} == {"auto"}


def test_without_a_finished_recovery_nothing_is_written(tmp_path: Path):
    assert write_results(made(tmp_path, ON_ROBOT)).files == ()
    assert not (tmp_path / "paper.md").exists()
