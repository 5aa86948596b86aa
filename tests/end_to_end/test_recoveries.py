"""The benchmark of recoveries: its rows are continued, and its ratios are those of the rows."""

import json
from pathlib import Path
from typing import Any

import pytest

from benchmarks.recoveries.cells import Cell, cells, compute, read_rows
from benchmarks.recoveries.recover import recovered
from benchmarks.recoveries.table import table
from selfmodel.settings import Settings

SMALL = Settings(steps=60, generations=1, trials=1).scaled(4)


def row(case: int, seed: int, upright: list[float], **other: object) -> dict[str, Any]:
    return {
        "robot": "quadruped",
        "case": case,
        "gap": 0.1,
        "seed": seed,
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


def test_the_seeds_change_last_and_a_finished_cell_is_not_run_again(tmp_path: Path):
    wanted = cells(["quadruped", "hexapod"], [1], [0.0], [0, 1])
    assert [(cell.robot, cell.seed) for cell in wanted[:2]] == [("quadruped", 0), ("hexapod", 0)]
    path = tmp_path / "rows.jsonl"
    path.write_text(json.dumps({"robot": "quadruped", "case": 1, "gap": 0.0, "seed": 0}) + "\n")

    assert list(compute(wanted[:1], dict, path, jobs=1)) == []
    assert len(read_rows(path)) == 1
    assert read_rows(tmp_path / "none.jsonl") == []


@pytest.mark.search
@pytest.mark.parametrize("repair", ["robust", "paper"])
def test_a_row_has_each_trial_with_its_prediction(repair: str):
    found = recovered(Cell("quadruped", 1, 0.05, 3), repair=repair, settings=SMALL)

    assert len(found["upright"]) == len(found["predicted"]) == len(found["falls"]) == 3
    assert found["predicted"][1] is None
    assert found["repair"] == repair
    json.dumps(found, allow_nan=False)
