"""The benchmark of recoveries: its rows are written, and its ratios are those of the rows."""

import json
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from benchmarks.recoveries.study import read_rows, recovered, study, write_rows
from benchmarks.recoveries.table import table
from selfmodel import load_robot, recover, simulated_robot
from selfmodel.recovery.scores import DISPLACEMENT, UPRIGHT
from selfmodel.settings import Settings
from selfmodel.studies.recoveries import evolve_gait

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


def test_the_seeds_change_last(tmp_path: Path):
    robots, options = ["quadruped", "hexapod"], {"repair": "robust", "settings": SMALL}
    wanted = study(tmp_path, robots, [1], [0.0], [0, 1], **options)

    assert [(point["robot"], point["seed"]) for point in wanted.points.values()] == [
        *(("quadruped", 0), ("hexapod", 0), ("quadruped", 1), ("hexapod", 1))
    ]


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
    options = {"repair": repair, "settings": SMALL}
    (cell,) = study(tmp_path, ["quadruped"], [1], [0.05], [3], **options).cells()
    evolve_gait(cell.needs["gait"].parameters, {}, tmp_path)
    found = recovered(cell.parameters, {"gait": tmp_path}, tmp_path)

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
    options = {"repair": "robust", "settings": SMALL}
    wanted = study(tmp_path, ["quadruped"], [1, 2], [0.1], [0], **options)
    assert wanted.run(workers=2) == ()
    rows = read_rows(write_rows(wanted))

    assert sorted(row["case"] for row in rows) == [1, 2]
    assert rows[0]["upright"][0] == rows[1]["upright"][0]
    assert len(list((tmp_path / "gaits").iterdir())) == 1
