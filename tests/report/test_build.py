import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from selfmodel.report.build import report_of
from selfmodel.report.charts import Table
from selfmodel.report.document import Report, Section, as_json
from selfmodel.report.html import html_of
from selfmodel.report.subject import Subject
from tests.helpers.browser import browses, built, read_failures, read_report

FRAMES = (0, 31, 59)


@pytest.fixture(scope="module")
def report(subject: Subject) -> Report:
    return report_of(subject)


def test_the_headline_says_what_happened_and_the_numbers_are_those_of_the_result(
    run: Path, report: Report
):
    result = json.loads((run / "result.json").read_text())

    assert report.headline.startswith(f"The quadruped moved {result['score']['before']:.3g} m")
    assert f"moved {result['score']['recovered']:.3g} m at best in 1 trial since" in report.headline
    assert result["diagnosis"][0]["hypothesis"] in report.headline


def test_every_section_of_a_run_is_there(report: Report):
    keys = [section.key for section in report.sections]

    assert keys == [
        *("trials", "hypotheses", "residual", "separation", "searches", "calibration", "gait"),
    ]


@built
def test_the_report_of_a_run_is_small(report: Report):
    assert len(html_of(report)) < 10_000_000


@built
@browses
@pytest.mark.process
def test_the_page_shows_the_numbers_of_the_json_and_the_angles_of_the_log(
    report: Report, subject: Subject, tmp_path: Path
):
    path = tmp_path / "report.html"
    path.write_bytes(html_of(report))

    shown = read_report(path, *FRAMES)

    assert (shown["errors"], shown["requests"], shown["unnamed"]) == ([], [], [])
    assert shown["headline"] == report.headline
    assert shown["headings"] == ["H1"] + ["H2"] * 8
    assert shown["phone"] == 390
    assert shown["canvas"]
    assert shown["keyboard"] == ["1", "0.01 s"]
    direction, first = shown["sorted"]
    assert (direction, first) == ("descending", sorted(first, reverse=True))
    assert _tables(shown) == _expected(as_json(report))
    measured = subject.damaged[0].behaviour
    assert shown["trial"] == "01-after"
    for frame in FRAMES:
        angles = shown["angles"][str(frame)]
        for column, name in enumerate(measured.names.hinges):
            logged = measured["joint_positions"][frame, column]
            assert np.allclose(angles[name][0], logged, rtol=0, atol=2e-4), (frame, name)
        assert angles["travel, m"][0][0] == measured["base_position"][frame, 0]


@built
@browses
@pytest.mark.process
def test_what_cannot_be_drawn_is_a_sentence_and_all_else_is_drawn(report: Report, tmp_path: Path):
    good = Table("Good", ("a",), ((1,),))
    bad = Table("Bad", ("a",), None)
    sections = (
        Section("half", "Half", (), (bad, good)),
        Section("textless", "Textless", None, (good,)),
        None,
        Section("whole", "Whole", ("Text.",), (good,)),
    )
    damaged = dataclasses.replace(report, sections=sections)
    paths = tmp_path / "damaged.html", tmp_path / "no-scene.html"
    paths[0].write_bytes(html_of(damaged))
    no_scene = dataclasses.replace(damaged, scene={"shots": []}, made_with=None)
    paths[1].write_bytes(html_of(no_scene))

    first, second = read_failures(*paths)

    motion, half, textless, whole = first["sections"]
    assert first["headline"] == second["headline"] == [report.headline]
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


def _tables(shown: dict) -> dict[str, list]:
    """Numbers of the tables in the page, by title; text is left out."""
    return {
        one["title"]: [[cell for cell in row if not isinstance(cell, str)] for row in one["rows"]]
        for one in shown["tables"]
        if one["title"] != "Trials"  # the one that was sorted
    }


def _expected(values: dict) -> dict[str, list]:
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
                rows = [list(row) for row in zip(*columns, strict=True)]
            case _:
                rows = _line_rows(item)
        numbers = [[cell for cell in row if isinstance(cell, int | float)] for row in rows]
        found[item["title"]] = numbers
    found.pop("Trials")
    return found


def _line_rows(chart: dict) -> list[list[float]]:
    axes = [one["x"] for one in chart["series"]]
    if all(axis == axes[0] for axis in axes):
        return [list(row) for row in zip(axes[0], *(s["y"] for s in chart["series"]), strict=True)]
    return [list(pair) for one in chart["series"] for pair in zip(one["x"], one["y"], strict=True)]
