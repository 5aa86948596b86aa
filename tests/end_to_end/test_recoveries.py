"""Recoveries of a study: those of ``recover``, with what each trial reached and was predicted."""

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from benchmarks.recoveries import rows_of, table
from selfmodel import recover, simulated_robot
from selfmodel.faults.registry import kind_names
from selfmodel.recovery.scores import UPRIGHT
from selfmodel.settings import Settings
from selfmodel.studies import suite

FAULTS = ("intact", "break:front_left_knee")
COMPARATOR = "forward-displacement"
SMALL = Settings(steps=40, generations=1, trials=1).scaled(4)
RUN = {"robot": "quadruped", "gap": 0.1}


def row(case: int, seed: int, upright: list[float], **other: object) -> dict[str, Any]:
    results = {"predicted": [9.0, None, 4.0, 5.0], "falls": [None] * 4, "correct": True}
    cell = {**RUN, "case": case, "seed": seed, "repair": "robust", "upright": upright}
    return {**cell, **results, **other}


def oracle(case: int, seed: int, upright: list[float], method: str = "oracle") -> dict[str, Any]:
    return {**RUN, "case": case, "seed": seed, "method": method, "upright": upright, "best": []}


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


def test_a_table_of_several_repairs_has_lines_of_each():
    rows = [row(1, 0, [8.0, 1, 3, 6]), row(1, 0, [4.0, 1, 2, 3], repair="paper")]
    lines = [line.split(" | ") for line in table(rows, []).splitlines()[2:]]

    assert [(line[0], line[1], line[3], line[5]) for line in lines] == [
        (f"| quadruped, {repair}", case, "1", before)
        for repair, before in (("paper", "4.0"), ("robust", "8.0"))
        for case in ("1", "all")
    ]


@pytest.mark.search
@pytest.mark.usefixtures("coarse_calibration")
def test_recoveries_of_a_study_are_those_of_recover_and_share_a_gait(tmp_path: Path):
    study = suite(
        tmp_path,
        bodies=["quadruped"],
        cases=[1, 2],
        seeds=[3],
        settings=SMALL,
        comparator=COMPARATOR,
        kinds=kind_names("break"),
        gap=0.05,
        repair="robust",
    )
    with ThreadPoolExecutor(1) as executor:
        assert study.run(executor=executor) == ()
    first, second = rows_of(tmp_path)

    assert len(first["upright"]) == len(first["predicted"]) == len(first["falls"]) == 3
    assert first["predicted"][1] is None
    assert (first["case"], first["repair"]) == (1, "robust")
    assert first["upright"][0] == second["upright"][0]
    assert len(list((tmp_path / "gaits").iterdir())) == 1
    json.dumps(first, allow_nan=False)
    alone = recover(
        *(simulated_robot("quadruped", fault, gap=0.05, seed=3) for fault in FAULTS),
        "quadruped",
        tmp_path / "run",
        kinds="break",
        comparator=COMPARATOR,
        settings=SMALL,
        seed=3,
        threads=1,
    )
    assert alone.score == UPRIGHT
    assert [round(value, 4) for value in alone.scores] == first["upright"]
