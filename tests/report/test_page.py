"""The page of a report: one file, whose data are no markup, and which shows every number."""

import json
import math
import re
import shutil
import subprocess
from pathlib import Path

import msgspec
import numpy as np
import pytest

from selfmodel.report.charts import LineChart, Report, Section, Series, Table, as_json, html_of
from selfmodel.report.content import report_of
from selfmodel.report.subject import Subject
from tests.helpers.browser import ROOT, browses, read_failures, read_report

FRAMES = (0, 31, 59)

HOSTILE = "</script><script>alert(1)</script><!-- \u2028 & <b>"

PAGE = ROOT / "report_page"

node = pytest.mark.skipif(shutil.which("node") is None, reason="no Node.js")


def run_node(*arguments: str) -> str:
    done = subprocess.run(
        ["node", *arguments], capture_output=True, text=True, check=False, timeout=60
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@node
@pytest.mark.skipif(
    not (PAGE / "node_modules" / ".ready").exists(), reason="no esbuild and three: make browser"
)
def test_the_page_in_the_package_is_that_of_its_sources(tmp_path: Path):
    run_node(str(PAGE / "build.mjs"), str(tmp_path / "template.html"))

    built = (tmp_path / "template.html").read_bytes()
    assert built == (ROOT / "selfmodel" / "report" / "template.html").read_bytes(), "run make page"


def test_no_text_of_a_report_ends_its_data_or_becomes_markup():
    page = html_of(Report(title=HOSTILE, headline=HOSTILE)).decode()

    (data,) = re.findall(r'<script type="application/json" id="report">(.*?)</script>', page)
    assert json.loads(data)["headline"] == HOSTILE
    assert "<title>&lt;/script&gt;" in page
    assert "<!--selfmodel" not in page


def test_the_page_names_no_address_that_a_browser_would_fetch():
    page = html_of(Report(title="t", headline="h")).decode()

    assert not re.search(r"""(src|href)=["']?(https?:)?//""", page)
    assert "default-src 'none'" in page


def test_numbers_keep_their_digits_and_one_that_is_not_finite_is_null():
    numbers = (0.1 + 0.2, math.nan, math.inf, None)
    chart = LineChart("t", "x", "y", (Series("a", (0.0, 1.0, 2.0, 3.0), numbers),))
    sections = (Section("one", "One", (), (chart, Table("t", ("a",), ((1,),)))),)

    values = json.loads(as_json(Report(title="t", headline="h", sections=sections)))

    line, table = values["sections"][0]["items"]
    assert line["series"][0]["y"] == [0.1 + 0.2, None, None, None]
    assert (line["kind"], table["kind"]) == ("line", "table")


@node
def test_the_page_shows_numbers_with_six_digits_and_no_ticks_between_neighbours(tmp_path: Path):
    script = tmp_path / "numbers.mjs"
    script.write_text(
        f'import {{ allDigits, text, ticks }} from "{PAGE / "src" / "numbers.js"}";\n'
        "const shown = [1234567, 123456789012, 0.12345678, -3, null].map(text);\n"
        'const whole = [1234567, 0.12345678, 0.123456, -1234567.8, "0.1"].map(allDigits);\n'
        "const none = [[-0.30000000000000004, -0.3], [1e16, 1e16 + 2], [0, 0]]\n"
        "  .map(([low, high]) => ticks(low, high, 5).length);\n"
        "process.stdout.write(JSON.stringify({ shown, whole, none, some: ticks(-0.31, 0.42, 5) }));"
    )

    found = json.loads(run_node(str(script)))

    assert found["shown"] == ["1234567", "123456789012", "0.123457", "-3", "\N{EN DASH}"]
    assert found["whole"] == [None, "0.12345678", None, "-1234567.8", None]
    assert found["none"] == [0, 0, 0]
    assert found["some"] == [-0.2, 0, 0.2, 0.4]


@browses
@pytest.mark.process
def test_the_page_shows_the_numbers_of_the_json_and_the_angles_of_the_log(
    subject: Subject, tmp_path: Path
):
    report, path = report_of(subject), tmp_path / "report.html"
    path.write_bytes(html_of(report))
    assert path.stat().st_size < 10_000_000

    shown = read_report(path, *FRAMES)

    assert (shown["errors"], shown["requests"], shown["unnamed"]) == ([], [], [])
    assert shown["headline"] == report.headline
    assert shown["headings"] == ["H1"] + ["H2"] * 8
    assert shown["phone"] == 390
    assert shown["canvas"]
    assert shown["keyboard"] == ["1", "0.01 s"]
    direction, first = shown["sorted"]
    assert (direction, first) == ("descending", sorted(first, reverse=True))
    tables = {one["title"]: one["rows"] for one in shown["tables"] if one["title"] != "Trials"}
    numbers = {title: [_numbers(row) for row in rows] for title, rows in tables.items()}
    assert numbers == _expected(json.loads(as_json(report)))
    measured = subject.damaged[0].trajectory
    assert shown["trial"] == "01-after"
    for frame in FRAMES:
        angles = shown["angles"][str(frame)]
        for column, name in enumerate(measured.names.hinges):
            logged = measured["joint_positions"][frame, column]
            assert np.allclose(angles[name][0], logged, rtol=0, atol=2e-4), (frame, name)
        assert angles["travel, m"][0][0] == measured["base_position"][frame, 0]


@browses
@pytest.mark.process
def test_what_cannot_be_drawn_is_a_sentence_and_all_else_is_drawn(subject: Subject, tmp_path: Path):
    good, bad = Table("Good", ("a",), ((1,),)), Table("Bad", ("a",), None)
    sections = (
        Section("half", "Half", (), (bad, good)),
        Section("textless", "Textless", None, (good,)),
        None,
        Section("whole", "Whole", ("Text.",), (good,)),
    )
    damaged = msgspec.structs.replace(report_of(subject), sections=sections)
    no_scene = msgspec.structs.replace(damaged, scene={"shots": []}, made_with=None)
    paths = tmp_path / "damaged.html", tmp_path / "no-scene.html"
    for path, report in zip(paths, (damaged, no_scene), strict=True):
        path.write_bytes(html_of(report))

    first, second = read_failures(*paths)

    motion, half, textless, whole = first["sections"]
    assert first["headline"] == second["headline"] == [damaged.headline]
    assert len(first["footer"]) == 1
    assert "The section undefined could not be drawn" in first["failures"][-1]
    assert "because this browser has no WebGL 2" in motion["failures"][0]
    assert motion["controls"] == 1
    assert "Bad could not be drawn (TypeError" in half["failures"][0]
    assert "The text of this section could not be drawn" in textless["failures"][0]
    assert [one["figures"] for one in (half, textless, whole)] == [1, 1, 1]
    assert whole["failures"] == []
    assert "The motion of the robots could not be drawn" in second["sections"][0]["failures"][0]
    assert [one["rows"] for one in second["sections"][1:]] == [1, 1, 1]
    sentences = [text for one in first["sections"] for text in one["failures"]]
    logged = [error for error in first["errors"] if "could not be drawn:" in error]
    assert len(logged) == len(sentences) + len(first["failures"])


def _numbers(row: list) -> list[float]:
    return [cell for cell in row if isinstance(cell, int | float)]


def _expected(values: dict) -> dict[str, list]:
    """Numbers of the tables that the page has for the items of a report, by title."""
    found = {}
    for item in (item for section in values["sections"] for item in section["items"]):
        match item["kind"]:
            case "file":
                continue
            case "table":
                rows = item["rows"]
            case "bars":
                rows = [group["values"] for group in item["groups"]]
            case "intervals":
                rows = [[one["value"], one["low"], one["high"]] for one in item["estimates"]]
            case "gait":
                lanes = [lane for group in item["groups"].values() for lane in group]
                rows = [span for lane in lanes for span in lane["spans"]]
            case "heat":
                columns = [item["begin"], item["end"], *(row["values"] for row in item["rows"])]
                rows = zip(*columns, strict=True)
            case _:
                rows = _line_rows(item)
        found[item["title"]] = [_numbers(row) for row in rows]
    found.pop("Trials")
    return found


def _line_rows(chart: dict) -> list[list[float]]:
    axes = [one["x"] for one in chart["series"]]
    if all(axis == axes[0] for axis in axes):
        return [list(row) for row in zip(axes[0], *(s["y"] for s in chart["series"]), strict=True)]
    return [list(pair) for one in chart["series"] for pair in zip(one["x"], one["y"], strict=True)]
