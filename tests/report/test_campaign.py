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
from selfmodel.report.charts import Cell, IntervalChart, Picture, Report, Table, html_of
from selfmodel.studies import rows as rows_of_studies
from selfmodel.studies.recoveries import ENDS
from selfmodel.studies.rows import KINDS, frame_of
from selfmodel.studies.tables import csv_bytes
from tests.helpers.browser import browses, read_report
from tests.helpers.study_rows import body, diagnosis

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
    report = report_of_campaign(folder)
    assert report.headline == "3 rows of 2 methods."
    assert "3 rows in results.csv" in report.verdict[0]
    (picture,) = items(folder, Picture)
    assert (picture.title, picture.media_type, picture.data) == ("gap", "image/png", PIXEL)


def test_right_diagnoses_are_shown_by_method_case_and_gap_and_never_pooled(folder: Path):
    (chart,) = items(folder, IntervalChart)
    tables = {table.title: table for table in items(folder, Table)}

    shares = [(one.label, one.value) for one in chart.estimates]
    assert shares == [("a (n = 2)", 1.0), ("b (n = 1)", 0.0)]
    by_gap = tables["Right diagnoses by gap"]
    assert by_gap.columns == ("method", "0.0", "0.1")
    assert by_gap.rows == (("a", "1/1", "1/1"), ("b", None, "0/1"))
    (folder / "results.csv").write_text("robot,correct\na,true\na,false\n")
    alone = report_of_campaign(folder).headline
    assert alone == "1 of 2 diagnoses are right: 50.0% (95 % interval 9.5% to 90.5%)."


def study(folder: Path, name: str, rows: list[dict]) -> Report:
    """The report of the folder of a study with these rows."""
    (folder / "results.csv").write_bytes(csv_bytes(frame_of(rows, KINDS[name].columns)))
    return report_of_campaign(folder)


def test_a_study_of_comparators_begins_with_its_paired_comparisons_of_each_robot(tmp_path: Path):
    rows = [
        diagnosis(name, robot=robot, case=case, seed=seed, truth="t", correct=right)
        for name, right in (("own:A", True), ("b", False))
        for robot in ("ant", "hexapod")
        for case in (1, 2)
        for seed in range(6)
    ]
    rows = [row | {"comparator_name": row["comparator"].removeprefix("own:")} for row in rows]
    report = study(tmp_path, "ablate", rows)
    comparisons, methods, shares, _ = report.sections

    assert report.headline == "2 methods in 48 rows: 2 of 2 paired comparisons are decided."
    assert report.verdict[0].startswith("ant, 1 trial: A has the largest mean, 1, and is better")
    assert [one.title for one in comparisons.items] == [
        f"{robot}, 1 trial: first minus second" for robot in ("ant", "hexapod")
    ]
    (pair,) = comparisons.items[0].estimates
    assert (pair.label, pair.value) == ("A \N{MINUS SIGN} b (n = 12, p 0.031)", 1)
    assert (pair.low < 1, pair.high, pair.note) == (True, 1, "")
    assert [one.label for one in methods.items[0].estimates] == ["A (n = 12)", "b (n = 12)"]
    (table,) = shares.items
    assert table.columns == ("robot", "method", "1", "2")
    assert table.rows[0] == ("ant", "A", "6/6", "6/6")


def test_with_several_searches_a_chart_has_the_pairs_that_differ_in_one_thing(tmp_path: Path):
    names = [(name, search) for name in "ab" for search in ("ea", "stepwise", "ea+stepwise")]
    rows = [
        diagnosis(name, diagnostic_search=search, seed=seed)
        for name, search in names
        for seed in range(4)
    ]
    report = study(tmp_path, "ablate", rows)
    chart, table = report.sections[0].items
    pairs = [one.label.split(" (n")[0].split(" \N{MINUS SIGN} ") for one in chart.estimates]

    assert len(pairs) == 3 + 2 * 3
    for first, second in pairs:
        assert len(set(first.split(" with ")) & set(second.split(" with "))) == 1
    assert len(table.rows) == 15
    assert (
        "a with stepwise, b with ea, b with ea+stepwise and b with stepwise have"
        in (report.verdict[0])
    )
    assert "the same search" in report.sections[-1].text[1]


def test_the_search_and_the_limit_of_an_ablation_are_below_the_headline(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    shared = {"settings": {"max_simulated_steps": 960}}
    monkeypatch.setattr(rows_of_studies, "shared_in", lambda _folder: shared)
    for searches, said in (
        (("ea",), "the search ea,"),
        (("ea", "ea+stepwise", "stepwise"), "the searches ea, ea+stepwise and stepwise,"),
    ):
        rows = [diagnosis(diagnostic_search=search) for search in searches]
        verdict = " ".join(study(tmp_path, "ablate", rows).verdict)
        assert f"has {said} and simulated at most 960 control steps" in verdict


def test_a_study_of_bodies_begins_with_what_they_recovered_and_marks_falls(tmp_path: Path):
    rows = [body(), body(robot="b", after=1.0)]
    rows += [body(1, best_trial=2.0, upright_best_trial=False, outcome="fell")]
    report = study(tmp_path, "suite", rows)
    (chart,) = report.sections[0].items

    said = "3 runs of 2 robots with a failure: 2 better, 1 fell."
    assert report.headline == said  # and no number of all bodies together
    assert [(group.label, group.values) for group in chart.groups] == [
        ("a, case 1: 1 better, 1 fell", (2.0, 0.0, 1.5)),
        ("b, case 1: 1 better", (2.0, 1.0, 1.0)),
    ]
    assert [group.notes for group in chart.groups] == [("", "", "fell in 1 of 2"), ("", "", "")]
    paid = [body(score="return", unit="", return_most=199)]
    (chart,) = study(tmp_path, "suite", paid).sections[0].items
    assert chart.x_label == "return (of 199)"


@browses
@pytest.mark.process
def test_the_label_of_a_bar_is_beside_it(tmp_path: Path):
    fell = {f"upright_{end}": False for end in ENDS}
    found = study(tmp_path, "suite", [body(**fell), body(robot="b", before=-1.0, best_trial=-2.0)])
    (page := tmp_path / "page.html").write_bytes(html_of(found))

    assert read_report(page)["illegible"] == []


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
