import base64
import json
from pathlib import Path

import pytest

from selfmodel.errors import InputError
from selfmodel.report.campaign import (
    MAX_INTEGER,
    other_lists,
    read_table,
    report_of_campaign,
)
from selfmodel.report.charts import Cell, IntervalChart, Picture, Table, html_of
from tests.helpers.browser import browses, read_report

PIXEL = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    rows = "robot,gap,comparator,correct,truth,distance\n"
    rows += "quadruped,0.0,a,true,break:x,0.1\nquadruped,0.1,b,false,,\nquadruped,0.1,a,true,t,2\n"
    (tmp_path / "results.csv").write_text(rows)
    (tmp_path / "cells.jsonl").write_text('{"cell": 1, "best": [1.5, 2]}\n{"cell": 2}\n')
    results = {"rows": [{"robot": "quadruped"}], "scores": [{"runs": 3, "time": {"low": 1.0}}]}
    (tmp_path / "results.json").write_text(json.dumps(results))
    (tmp_path / "figures").mkdir()
    (tmp_path / "figures" / "gap.png").write_bytes(PIXEL)
    return tmp_path


def items(folder: Path, kind: type) -> list:
    sections = report_of_campaign(folder).sections
    return [item for section in sections for item in section.items if isinstance(item, kind)]


def test_every_table_and_figure_of_the_folder_is_in_the_report(folder: Path):
    tables = {table.title: table for table in items(folder, Table)}

    assert tables["results.csv"].columns[:3] == ("robot", "gap", "comparator")
    assert tables["results.csv"].rows[1] == ("quadruped", 0.1, "b", False, None, None)
    assert tables["cells.jsonl"].rows == ((1, "1.5, 2"), (2, None))
    assert tables["scores"].columns == ("runs", "time low")
    assert "rows" not in tables
    headline = report_of_campaign(folder).headline
    assert headline.startswith("2 of 3 diagnoses are right: 66.7% (95 % interval 20.8% to 93.9%)")
    assert "3 rows in results.csv" in headline
    (picture,) = items(folder, Picture)
    assert (picture.title, picture.media_type, picture.data) == ("gap", "image/png", PIXEL)


def test_shares_are_shown_by_each_column_that_varies(folder: Path):
    charts = {chart.title: chart for chart in items(folder, IntervalChart)}

    assert [title.split(",")[0] for title in charts] == [
        "Share of right diagnoses by comparator",
        "Share of right diagnoses by gap",
    ]
    by_comparator = charts["Share of right diagnoses by comparator, with 95 % intervals"]
    shares = [(one.label, one.value) for one in by_comparator.estimates]
    assert shares == [("a (n = 2)", 1.0), ("b (n = 1)", 0.0)]


@browses
@pytest.mark.process
def test_a_large_campaign_is_printed_without_loss_of_columns_and_read_on_a_phone(tmp_path: Path):
    columns = [*(f"column_{k}" for k in range(20)), "truth", "correct"]
    row = [*(f"{0.123456 + k}" for k in range(20)), "break:front_left_knee+jam:middle_right_hip"]
    lines = [",".join([*row, str(k % 3 == 0).lower()]) for k in range(210)]
    (tmp_path / "results.csv").write_text("\n".join([",".join(columns), *lines]))
    (tmp_path / "gap.png").write_bytes(PIXEL)
    (tmp_path / "report.html").write_bytes(html_of(report_of_campaign(tmp_path)))

    shown = read_report(tmp_path / "report.html")

    assert (shown["errors"], shown["requests"], shown["unnamed"]) == ([], [], [])
    assert shown["headline"].startswith("70 of 210 diagnoses are right")
    assert shown["phone"] == 390
    (table,) = [one for one in shown["tables"] if one["title"] == "results.csv"]
    assert len(table["rows"]) == 210
    assert shown["print"] == [{"rows": 60, "beyond": 0}]


def test_figures_beyond_the_limit_are_left_out_and_named(folder: Path):
    (folder / "large.svg").write_bytes(bytes(len(PIXEL) + 1))

    report = report_of_campaign(folder, most_figures=len(PIXEL))

    assert [picture.title for picture in report.sections[-1].items] == ["gap"]
    assert "large.svg" in report.sections[-1].text[0]


def test_a_folder_without_tables_is_no_campaign(tmp_path: Path):
    with pytest.raises(InputError, match="or of a campaign with a table such as"):
        report_of_campaign(tmp_path)


@pytest.mark.parametrize("name", ["cells.jsonl", "results.json"])
def test_a_damaged_file_is_named(folder: Path, name: str):
    (folder / name).write_text("{")

    with pytest.raises(InputError, match=name):
        report_of_campaign(folder)


def column(tmp_path: Path, name: str, *cells: str) -> list[Cell]:
    """The cells of a column of a CSV file, as they are read."""
    path = tmp_path / "results.csv"
    path.write_text("\n".join([f"{name},end", *(f"{cell}," for cell in cells)]), encoding="utf-8")
    return [row[name] for row in read_table(path)]


@pytest.mark.parametrize(
    "cells",
    [
        ("007", "12"),
        ("3.10", "3.11.2"),
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


@pytest.mark.parametrize(
    ("cells", "expected"),
    [
        (("0", "0.0", "-0.50", "10"), [0, 0.0, -0.5, 10]),
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
    path = tmp_path / "results.csv"
    found = column(tmp_path, "distance", *cells)

    assert found == expected
    assert [type(one) for one in found] == [type(one) for one in expected]
    path.write_text(path.read_text(), encoding="utf-8-sig")  # as spreadsheets write it
    assert [row["distance"] for row in read_table(path)] == expected
    assert column(tmp_path, "MuJoCo version", "3.9", "3.10") == ["3.9", "3.10"]


@pytest.mark.parametrize("name", ["cells.jsonl", "results.json"])
def test_an_integer_of_json_that_the_page_would_round_is_a_text(tmp_path: Path, name: str):
    large = MAX_INTEGER + 2
    record = {"seed": large, "inner": {"seed": -large}, "held": MAX_INTEGER, "right": True}
    path = tmp_path / name
    path.write_text(json.dumps(record if name == "cells.jsonl" else {"scores": [record]}))

    (found,) = read_table(path) if name == "cells.jsonl" else other_lists(tmp_path)["scores"]

    texts = {"seed": str(large), "inner seed": str(-large)}
    assert found == {**texts, "held": MAX_INTEGER, "right": True}
