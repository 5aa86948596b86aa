import base64
import json
from pathlib import Path

import pytest

from selfmodel.errors import InputError
from selfmodel.report.campaign import is_campaign, report_of_campaign
from selfmodel.report.charts import IntervalChart, Picture, Table
from selfmodel.report.html import html_of
from tests.helpers.browser import browses, built, read_report

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


def test_every_table_of_the_folder_is_in_the_report(folder: Path):
    tables = {table.title: table for table in items(folder, Table)}

    assert tables["results.csv"].columns[:3] == ("robot", "gap", "comparator")
    assert tables["results.csv"].rows[1] == ("quadruped", 0.1, "b", False, None, None)
    assert tables["cells.jsonl"].rows == ((1, "1.5, 2"), (2, None))
    assert tables["scores"].columns == ("runs", "time low")
    assert "rows" not in tables


def test_the_headline_has_the_share_of_right_diagnoses_with_its_interval(folder: Path):
    headline = report_of_campaign(folder).headline

    assert headline.startswith("2 of 3 diagnoses are right: 66.7% (95 % interval 20.8% to 93.9%)")
    assert "3 rows in results.csv" in headline


def test_shares_are_shown_by_each_column_that_varies(folder: Path):
    charts = {chart.title: chart for chart in items(folder, IntervalChart)}

    assert [title.split(",")[0] for title in charts] == [
        "Share of right diagnoses by comparator",
        "Share of right diagnoses by gap",
    ]
    by_comparator = charts["Share of right diagnoses by comparator, with 95 % intervals"]
    shares = [(one.label, one.value) for one in by_comparator.estimates]
    assert shares == [("a (n = 2)", 1.0), ("b (n = 1)", 0.0)]


def test_diagnoses_after_other_numbers_of_trials_have_shares_of_their_own(tmp_path: Path):
    rows = "robot,trials,correct\nquadruped,1,false\nquadruped,3,true\nquadruped,1,false\n"
    (tmp_path / "results.csv").write_text(rows)

    (chart,) = items(tmp_path, IntervalChart)

    assert chart.title.startswith("Share of right diagnoses by trials")
    assert [(one.label, one.value) for one in chart.estimates] == [
        *(("1 (n = 2)", 0.0), ("3 (n = 1)", 1.0))
    ]


@built
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


def test_figures_are_in_the_report_as_they_are(folder: Path):
    (picture,) = items(folder, Picture)

    assert (picture.title, picture.media_type) == ("gap", "image/png")
    assert base64.b64decode(picture.data) == PIXEL


def test_figures_beyond_the_limit_are_left_out_and_named(
    folder: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("selfmodel.report.campaign.MAX_FIGURE_BYTES", len(PIXEL))
    (folder / "large.svg").write_bytes(bytes(len(PIXEL) + 1))

    assert [picture.title for picture in items(folder, Picture)] == ["gap"]
    assert report_of_campaign(folder).sections[-1].text[0].endswith("too large: large.svg.")


def test_rows_without_a_judgement_or_a_factor_are_left_out_of_the_shares(tmp_path: Path):
    rows = [{"cell": 1}, {"correct": True, "robot": "a"}, {"correct": False}, {"correct": None}]
    rows += [{"correct": False, "robot": "b"}]
    (tmp_path / "cells.jsonl").write_text("\n".join(map(json.dumps, rows)))

    assert report_of_campaign(tmp_path).headline.startswith("1 of 3 diagnoses are right")
    (chart,) = items(tmp_path, IntervalChart)
    assert [one.label for one in chart.estimates] == ["a (n = 1)", "b (n = 1)"]


def test_a_line_of_json_may_hold_a_separator_of_lines_in_a_text(tmp_path: Path):
    (tmp_path / "cells.jsonl").write_text('{"a": "x\u2028y"}\n', encoding="utf-8")

    assert items(tmp_path, Table)[0].rows == (("x\u2028y",),)


def test_lists_without_objects_make_no_empty_tables(folder: Path):
    (folder / "results.json").write_text('{"seeds": [1, 2], "none": [], "empty": [{}]}')

    assert {table.title for table in items(folder, Table)} == {"results.csv", "cells.jsonl"}


def test_a_folder_without_tables_is_no_campaign(tmp_path: Path):
    assert not is_campaign(tmp_path)
    with pytest.raises(InputError, match="or of a campaign with a table such as"):
        report_of_campaign(tmp_path)


@pytest.mark.parametrize("name", ["cells.jsonl", "results.json"])
def test_a_damaged_file_is_named(folder: Path, name: str):
    (folder / name).write_text("{")

    with pytest.raises(InputError, match=name):
        report_of_campaign(folder)
