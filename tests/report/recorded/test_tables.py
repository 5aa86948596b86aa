import json
from pathlib import Path

import pytest

from selfmodel.report.charts import Cell
from selfmodel.report.recorded.tables import MAX_INTEGER, other_lists, read_table


def column(tmp_path: Path, name: str, *cells: str) -> list[Cell]:
    """The cells of a column of a CSV file, as they are read."""
    path = tmp_path / "results.csv"
    path.write_text("\n".join([f"{name},end", *(f"{cell}," for cell in cells)]), encoding="utf-8")
    return [row[name] for row in read_table(path)]


@pytest.mark.parametrize(
    "cells",
    [
        ("007", "12"),
        ("0012e3", "1.5"),
        ("-01", "2"),
        ("3.10", "3.11.2"),
        ("12345e6", "a1b2c3d"),
        ("1_000", "7"),
        (str(MAX_INTEGER + 1), "7"),
        ("1" + 5000 * "0", "7"),
    ],
    ids=lambda cells: cells[0][:12],
)
def test_a_column_whose_numbers_would_lose_digits_stays_as_it_is_in_the_file(
    tmp_path: Path, cells: tuple[str, ...]
):
    assert column(tmp_path, "name", *cells) == list(cells)


def test_a_column_named_version_stays_as_it_is_in_the_file(tmp_path: Path):
    assert column(tmp_path, "MuJoCo version", "3.9", "3.10") == ["3.9", "3.10"]


@pytest.mark.parametrize(
    ("cells", "expected"),
    [
        (("0", "0.0", "-0.5", "10"), [0, 0.0, -0.5, 10]),
        (("0.10", "0.05", "1.20"), [0.1, 0.05, 1.2]),
        (("-0.20", "1.10"), [-0.2, 1.1]),
        (("1.20e-05", "3.10e-02"), [1.2e-5, 0.031]),
        (("", "7", "nan"), [None, 7, None]),
        (("inf", "2.5", "1e999"), ["inf", 2.5, "1e999"]),
        ((str(MAX_INTEGER), "-7"), [MAX_INTEGER, -7]),
        (("true", "False", ""), [True, False, None]),
    ],
    ids=lambda cells: str(cells[0])[:12],
)
def test_a_column_of_numbers_has_numbers_and_one_of_truth_values_has_those(
    tmp_path: Path, cells: tuple[str, ...], expected: list[Cell]
):
    found = column(tmp_path, "distance", *cells)

    assert found == expected
    assert [type(one) for one in found] == [type(one) for one in expected]


def test_a_short_row_has_empty_cells_and_a_byte_order_mark_is_no_name(tmp_path: Path):
    path = tmp_path / "results.csv"
    path.write_text("seed,gap\n7,0.1\n8\n", encoding="utf-8-sig")

    assert read_table(path) == [{"seed": 7, "gap": 0.1}, {"seed": 8, "gap": None}]


@pytest.mark.parametrize("name", ["cells.jsonl", "results.json"])
def test_an_integer_of_json_that_the_page_would_round_is_a_text(tmp_path: Path, name: str):
    large = MAX_INTEGER + 2
    record = {"seed": large, "inner": {"seed": -large}, "held": MAX_INTEGER, "right": True}
    path = tmp_path / name
    path.write_text(json.dumps(record if name == "cells.jsonl" else {"scores": [record]}))

    (found,) = read_table(path) if name == "cells.jsonl" else other_lists(tmp_path)["scores"]

    texts = {"seed": str(large), "inner seed": str(-large)}
    assert found == {**texts, "held": MAX_INTEGER, "right": True}
