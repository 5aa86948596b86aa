"""Rows of baselines, and their summaries."""

import json
from pathlib import Path

import pytest

from selfmodel.errors import InputError
from selfmodel.experiments.baseline.results import BaselineRow, summarise, write_results
from selfmodel.experiments.grid import Cell
from selfmodel.experiments.grid.cell_file import CELL, cell_bytes


def row(method: str, upright: list[float], seed: int = 0) -> BaselineRow:
    best = [max(upright[: k + 1]) for k in range(len(upright))]
    return BaselineRow(
        method=method,
        robot="quadruped",
        case=2,
        truth="break:front_left_knee",
        gap=0.1,
        seed=seed,
        best=best,
        upright=upright,
        displacement=upright,
        fallen=[False] * len(upright),
        steps=[10] * len(upright),
        simulated_steps=100,
        seconds=1.0,
    )


def test_the_value_of_the_oracle_is_the_mean_of_its_trials():
    assert row("oracle", [1.0, 3.0]).value(1) == 2
    assert row("random-search", [1.0, 3.0]).value(1) == 1


def test_a_method_that_ended_early_keeps_its_best_trial():
    values = [row("trial-and-error", [1.0, 3.0, 2.0]).value(trials) for trials in (1, 2, 20)]

    assert values == [1, 3, 3]


def test_methods_are_divided_by_the_oracle_on_the_same_physical_robot():
    rows = [
        row("oracle", [2.0, 2.0], seed=0),
        row("oracle", [4.0, 4.0], seed=1),
        row("random-search", [1.0, 2.0, 0.0, 3.0], seed=0),
        row("random-search", [1.0, 1.0, 1.0, 1.0], seed=1),
        row("random-search", [9.0, 9.0, 9.0, 9.0], seed=2),
    ]
    found = {one.method: one for one in summarise(rows)}

    assert found["oracle"].ratios == [1, 1, 1]
    assert found["random-search"].ratios == pytest.approx([0.375, 0.625, 0.875])
    assert found["random-search"].values == [1, 2, 3]
    assert (found["random-search"].runs, found["random-search"].trials) == (3, 4)


def test_without_an_oracle_there_are_no_ratios():
    (found,) = summarise([row("random-search", [1.0])])

    assert found.ratios is None


def test_a_row_with_other_keys_is_an_error_with_the_remedy(tmp_path: Path):
    cell = Cell("made:up", "one", {}, 0)
    folder = tmp_path / cell.place
    folder.mkdir(parents=True)
    (folder / CELL).write_bytes(cell_bytes(folder, cell, {"method": "oracle"}, 1.0, {}))

    with pytest.raises(InputError, match=r"expected the row of a baseline .* delete the file"):
        write_results(tmp_path)


def test_a_study_without_finished_runs_has_no_rows(tmp_path: Path):
    results = write_results(tmp_path)

    assert (results.rows, results.summaries) == ((), ())
    assert json.dumps(results.as_dict())
