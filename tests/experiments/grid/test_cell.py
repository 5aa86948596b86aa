"""Promises of a cell's place: the same computation has the same one, any other another."""

import dataclasses

import pytest

from selfmodel.experiments.grid.cell import MAX_NAME, Cell, with_needs
from selfmodel.logs import result_files

CELL = Cell("package.module:function", "run-01", {"gap": 0.05, "robots": ["a"]}, 1, "auto")


def test_the_place_has_the_names_for_a_reader_and_is_the_same_for_equal_inputs():
    same = dataclasses.replace(CELL, parameters={"robots": ("a",), "gap": 0.05})

    assert CELL.place == same.place
    assert CELL.place.startswith("runs/run-01-auto-")


@pytest.mark.parametrize(
    "change",
    [
        {"function": "package.module:other"},
        {"key": "run-02"},
        {"parameters": {"gap": 0.1, "robots": ["a"]}},
        {"seed": 2},
        {"part": "other"},
        {"needs": {"gait": Cell("m:f", "gait", {}, 0)}},
    ],
    ids=lambda change: next(iter(change)),
)
def test_any_other_computation_has_another_place(change: dict):
    assert dataclasses.replace(CELL, **change).place != CELL.place


def test_another_version_has_another_place(monkeypatch: pytest.MonkeyPatch):
    before, again = CELL.place, dataclasses.replace(CELL)
    others = {**result_files.versions(), "mujoco": "0.0.0"}
    monkeypatch.setattr(result_files, "versions", lambda: others)

    assert again.place != before


@pytest.mark.parametrize("part", ["package.module:object", "a/b", "../..", "ü" * 300, ""])
def test_any_part_has_a_folder_name(part: str):
    kind, _, name = dataclasses.replace(CELL, part=part).place.partition("/")

    assert kind == "runs"
    assert "/" not in name
    assert len(name.encode()) <= MAX_NAME + 17
    assert not name.startswith(".")


def test_inputs_that_are_no_json_are_refused():
    with pytest.raises(ValueError, match="not JSON compliant"):
        _ = dataclasses.replace(CELL, parameters={"gap": float("nan")}).place


def test_what_several_cells_need_is_listed_once_and_first():
    gait = Cell("m:f", "gait", {}, 0)
    equal = Cell("m:f", "gait", {}, 0)
    one, two = (
        dataclasses.replace(CELL, seed=n, needs={"g": g}) for n, g in enumerate((gait, equal))
    )

    assert list(with_needs([one, two])) == [gait.place, one.place, two.place]
