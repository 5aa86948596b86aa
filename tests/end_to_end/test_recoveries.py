"""The benchmark of recoveries: its rows are written, and its ratios are those of the rows."""

import dataclasses
import json
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from benchmarks.recoveries.cells import cells, read_rows, write_rows
from benchmarks.recoveries.recover import make_gait, recovered
from benchmarks.recoveries.table import table
from selfmodel import load_robot, recover, simulated_robot
from selfmodel.experiments.grid import Cell, processes, run_grid
from selfmodel.experiments.grid.cell_file import CELL, cell_bytes
from selfmodel.recovery.scores import DISPLACEMENT, UPRIGHT
from selfmodel.settings import Settings

FAULTS = ("intact", "break:front_left_knee")
SMALL = Settings(steps=60, generations=1, trials=1).scaled(4)


def row(case: int, seed: int, upright: list[float], **other: object) -> dict[str, Any]:
    return {
        "robot": "quadruped",
        "case": case,
        "gap": 0.1,
        "seed": seed,
        "repair": "robust",
        "correct": True,
        "upright": upright,
        "predicted": [9.0, None, 4.0, 5.0],
        "falls": [None] * 4,
        **other,
    }


def oracle(case: int, seed: int, upright: list[float], method: str = "oracle") -> dict[str, Any]:
    cell = {"robot": "quadruped", "case": case, "gap": 0.1, "seed": seed}
    return {**cell, "method": method, "upright": upright}


def test_ratios_are_to_the_oracle_of_the_same_robot_and_the_gait_before_counts_once():
    rows = [row(1, 0, [8.0, 1, 3, 6]), row(2, 0, [8.0, 1, 5, 2], falls=[None, None, 7, None])]
    oracles = [oracle(1, 0, [5.0, 7.0]), oracle(2, 0, [4.0]), oracle(9, 0, [10.0])]
    oracles += [oracle(1, 0, [99.0], "random-search"), oracle(1, 1, [99.0])]
    first, second, both = (line.split(" | ") for line in table(rows, oracles).splitlines()[2:])

    assert first[6:9] == ["0.80 (n 1)", "0.50 (n 1)", "1.00 (n 1)"]
    assert second[7:9] == ["1.25 (n 1)", "1.25 (n 1)"]
    assert both[5:8] == ["8.0", "0.80 (n 1)", "0.88 (n 2)"]
    assert both[9] == "0.97 (n 4)"  # 3/4, 6/5, 5/4, 2/5
    assert (first[10], second[10], both[10]) == ("0 of 1 |", "1 of 1 |", "1 of 2 |")


def test_the_seeds_change_last():
    wanted = cells(["quadruped", "hexapod"], [1], [0.0], [0, 1], repair="robust", settings=SMALL)

    assert [(cell.parameters["robot"], cell.seed) for cell in wanted] == [
        *(("quadruped", 0), ("hexapod", 0), ("quadruped", 1), ("hexapod", 1))
    ]


def finish(study: Path, cell: Cell, result: dict[str, Any]) -> None:
    """Writes a cell as finished."""
    folder = study / cell.place
    folder.mkdir(parents=True)
    (folder / CELL).write_bytes(cell_bytes(folder, cell, result, 1.0, {}))


def test_the_rows_of_finished_cells_are_written(tmp_path: Path):
    wanted = cells(["quadruped"], [1, 2], [0.0], [0], repair="robust", settings=SMALL)
    finish(tmp_path, wanted[0], row(1, 0, [1.0]))

    assert read_rows(write_rows(tmp_path, wanted)) == [row(1, 0, [1.0])]


def test_rows_of_another_repair_or_budget_in_the_folder_are_left_out(tmp_path: Path):
    larger = dataclasses.replace(SMALL, generations=2)
    studies = [
        cells(["quadruped"], [1], [0.0], [0], repair=repair, settings=settings)
        for repair, settings in (("robust", SMALL), ("paper", SMALL), ("robust", larger))
    ]
    for number, (cell,) in enumerate(studies):
        finish(tmp_path, cell, row(1, 0, [float(number)]))

    for number, wanted in enumerate(studies):
        assert read_rows(write_rows(tmp_path, wanted)) == [row(1, 0, [float(number)])]


def test_a_table_of_several_repairs_has_lines_of_each():
    rows = [row(1, 0, [8.0, 1, 3, 6]), row(1, 0, [4.0, 1, 2, 3], repair="paper")]
    lines = [line.split(" | ") for line in table(rows, []).splitlines()[2:]]

    assert [(line[0], line[1], line[3], line[5]) for line in lines] == [
        ("| quadruped, paper", "1", "1", "4.0"),
        ("| quadruped, paper", "all", "1", "4.0"),
        ("| quadruped, robust", "1", "1", "8.0"),
        ("| quadruped, robust", "all", "1", "8.0"),
    ]


@pytest.mark.search
@pytest.mark.parametrize("repair", ["robust", "paper"])
def test_a_row_has_each_trial_with_its_prediction(repair: str, tmp_path: Path):
    (cell,) = cells(["quadruped"], [1], [0.05], [3], repair=repair, settings=SMALL)
    make_gait(cell.needs["gait"], {}, tmp_path)
    found = recovered(cell, {"gait": tmp_path}, tmp_path)

    assert len(found["upright"]) == len(found["predicted"]) == len(found["falls"]) == 3
    assert found["predicted"][1] is None
    assert found["repair"] == repair
    json.dumps(found, allow_nan=False)
    scores = {"robust": UPRIGHT, "paper": DISPLACEMENT}
    alone = recover(
        *(simulated_robot("quadruped", fault, gap=0.05, seed=3) for fault in FAULTS),
        "quadruped",
        tmp_path / "run",
        settings=SMALL,
        seed=3,
        threads=1,
        repair=repair,
    )
    assert alone.score == scores[repair]
    of_trial = partial(UPRIGHT.of_trial, load_robot("quadruped"))
    before, *_ = map(of_trial, alone.tried, alone.trials)
    assert round(before, 4) == found["upright"][0]


@pytest.mark.process
@pytest.mark.search
def test_two_processes_share_a_gait(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2]))
    wanted = cells(["quadruped"], [1, 2], [0.1], [0], repair="robust", settings=SMALL)
    assert run_grid(tmp_path, wanted, workers=processes(2), on_progress=lambda _: None) == ()
    rows = read_rows(write_rows(tmp_path, wanted))

    assert sorted(row["case"] for row in rows) == [1, 2]
    assert rows[0]["upright"][0] == rows[1]["upright"][0]
    assert len(list((tmp_path / "gaits").iterdir())) == 1
