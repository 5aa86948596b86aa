"""Promises of the paper's experiment: medians over runs, fair costs, and what the paper reports."""

import csv
import json
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from selfmodel.settings import Settings
from selfmodel.studies import figures, paper_page
from selfmodel.studies.paper_page import (
    NOT_RESTORED,
    UNKNOWN,
    PaperResults,
    best_so_far,
    page,
    results_of,
    tables_of,
)
from selfmodel.studies.recoveries import ON_ROBOT
from selfmodel.studies.tables import csv_bytes, write_files
from selfmodel.tasks import ROBOTS
from tests.helpers.study_rows import evolution, recovery, trials


def results(rows: Iterable, trial_rows: Iterable = (), grown: Iterable = ()) -> PaperResults:
    return PaperResults(Settings(), list(rows), list(trial_rows), list(grown))


def test_a_row_of_table_two_has_medians_and_counts_of_its_runs():
    rows = [
        recovery(seed=0, recovered=1.0),
        recovery(seed=1, recovered=1.6, correct=False),
        recovery(seed=2, recovered=4.0),
        recovery(seed=3, recovered=9.0, before=-0.1),  # did not walk forward: in no ratio
    ]
    found, other = results([*rows, recovery(case=7, before=0.0)]).summaries()

    assert (found["runs"], found["right"], found["best"]) == (4, 3, "intact")
    assert (found["recovered"], found["recovery"]) == (2.8, 0.8)
    assert (found["lowest"], found["highest"]) == (0.5, 2.0)
    assert found["restored"] == 2  # 0.8 is restored, 0.5 is not
    assert (found["restored_in_paper"], other["restored_in_paper"]) == (True, False)
    assert (other["recovery"], other["lowest"]) == (None, None)


def test_a_comparator_of_ones_own_has_its_name_in_summaries_and_its_path_in_rows():
    own = {"comparator": "dtw:DTW"}
    found = results([recovery(comparator_name="dtw", **own)], trials([2.0, 0.0, 1.0], **own))

    assert [row["comparator"] for row in found.summaries()] == ["dtw"]
    assert {cost["way"] for cost in found.costs()} == {"dtw"}
    assert {row["comparator"] for row in (*found.recoveries, *found.trials)} == {"dtw:DTW"}


def test_costs_are_of_the_runs_that_all_ways_of_a_robot_have():
    easy, hard = {"case": 9}, {"case": 7}
    rows = [
        *trials([2.0, 0.0, 2.0], **easy),
        *trials([2.0, 0.0, 1.0], **hard),
        *trials([2.0, 0.0, 2.0], comparator="b", **hard),
        *trials([2.0, 0.0, 2.0], robot="hexapod"),  # paired for itself
    ]
    found = results([], rows, evolution([0.5, 1.0], **hard))

    assert {
        (cost["robot"], cost["way"], cost["physical_trials"]): cost["recovery"]
        for cost in found.costs()
    } == {
        ("quadruped", "a", 1): 0.5,
        ("quadruped", "b", 1): 1.0,
        ("quadruped", ON_ROBOT, 10): 0.25,
        ("quadruped", ON_ROBOT, 20): 0.5,
        ("hexapod", "a", 1): 1.0,
    }
    assert sorted(cost["physical_trials"] for cost in found.last_costs()) == [1, 1, 1, 20]
    seeds = [row for seed in range(5) for row in trials([2.0, 0.0, float(seed)], seed=seed)]
    (one,) = results([], seeds).costs()
    assert (one["low"], one["recovery"], one["high"], one["runs"]) == (0.5, 1.0, 1.5, 5)
    assert results([], trials([2.0, 0.0, 2.0]), evolution([1.0], case=2)).costs() == []


def test_page_and_files_have_the_tables_the_figures_and_what_is_not_known(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    rows = [recovery(), recovery(case=7, correct=False), recovery(robot="hexapod", case=7)]
    rows += [recovery(robot="hexapod", case=7, seed=1, distinct_hypotheses=51)]
    given = results(rows, trials([2.0, 0.0, 1.0, 3.0]), evolution([1.0]))
    monkeypatch.setattr(paper_page, "collect", lambda _folder: given)
    monkeypatch.setattr(paper_page, "files_of", lambda name, _figure: {f"{name}.png": b""})
    files = write_files(tmp_path, results_of(tmp_path).files)
    text = (tmp_path / "paper.md").read_text()

    assert {path.stem for path in files if path.suffix == ".png"} == {
        *("figure-1", "figure-5", "figure-6"),
    }
    assert all(f"({path.name})" in text for path in files if path.suffix == ".png")
    for line in (
        "| 1 | a lower leg breaks off | quadruped | break:front_left_knee |",
        "| quadruped | 7 | a | not restored | 1 of 1 | 0 of 1 | 2.00 | 0.50 | 2.00 | 1.00 |",
        f"| quadruped | {ON_ROBOT} | 10 | 1 | 0.50 |",
        "| quadruped | a | 2 | 1 | 1.50 |",
        "7, 8 of the quadruped; 4, 7, 10 of the hexapod",
        "trials after the failing one: 3; the paper's.",
        *UNKNOWN,
    ):
        assert line in text
    kept = json.loads((tmp_path / "results.json").read_text())
    assert [row["case"] for row in kept["table_2"]] == [1, 7, 7]
    with (tmp_path / "costs.csv").open() as file:
        assert [row["recovery"] for row in csv.DictReader(file)] == ["0.5", "1.5", "0.5"]
    assert [csv_bytes(table.records) for table in tables_of(given)][1] == (
        tmp_path / "table-2.csv"
    ).read_bytes()
    with (tmp_path / "table-2.csv").open() as file:
        assert [row["distinct_hypotheses"] for row in csv.DictReader(file)] == [
            "50.0",
            "50.0",
            "50.5",
        ]
    assert "figure-6" not in page(results(rows))


def test_figure_five_has_medians_of_its_runs_and_greys_what_the_paper_did_not_restore():
    rows = [
        row
        for seed, last in enumerate((1.0, 2.0, 6.0))
        for case in (4, 7, 9)
        for row in trials([2.0, 0.5, 1.0, last], seed=seed, robot="hexapod", case=case)
    ]
    rows += trials([0.0, 0.5, 1.0, 1.0], robot="hexapod", case=1)  # did not walk forward
    (axes,) = figures.by_trial(rows, NOT_RESTORED, best_so_far).axes
    drawn = [np.asarray(line.get_ydata()) for line in axes.get_lines()]

    assert sum(np.array_equal(line, [0.25, 0.5, 1.0]) for line in drawn) == 3
    assert all(np.isfinite(line).all() for line in drawn)
    assert len(axes.patches) == 2
    assert axes.get_title() == "hexapod (n = 1 to 3 per line)"


def test_figure_one_has_every_joint_and_sensor_of_a_robot():
    robot = ROBOTS["quadruped"].robot()
    kinds = [sensor.kind for sensor in robot.anatomy.sensors]

    for axes in figures.robots([robot]).axes:
        assert {line.get_label(): len(line.get_xdata()) for line in axes.get_lines()} == {
            "joint": len(robot.anatomy.joints),
            "angle sensor": kinds.count("angle"),
            "touch sensor": kinds.count("touch"),
        }
