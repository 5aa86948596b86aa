import json
import shutil
from importlib import import_module
from pathlib import Path

import pytest

from selfmodel.report.charts import Report, html_of
from tests.helpers.command import SMALL, refused, selfmodel, succeeds

FEW = (*SMALL, "--kinds", "break,jam-angle")
BANK = Path(__file__).parents[2] / "benchmarks" / "bank" / "quadruped-0.npz"


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a log before and a log after a failure."""
    folder = tmp_path_factory.mktemp("logs")
    common = ("--controller", str(BANK), "--steps", "80")
    trials = (("before", "--stage", "before"), ("after", "--damage", "jam:back_left_knee=0.3"))
    for name, *options in trials:
        succeeds("trial", "quadruped", *common, *options, "--out", f"{name}.mcap", cwd=folder)
    return folder


@pytest.fixture(scope="module")
def diagnosed(logs: Path) -> Path:
    """The JSON file of a diagnosis of the logs."""
    done = succeeds("diagnose", "before.mcap", "after.mcap", *FEW, "--json", cwd=logs)
    (logs / "found.json").write_text(done.stdout)
    return logs / "found.json"


def test_logs_are_diagnosed_and_reported_and_a_diagnosis_made_before_gives_the_same(
    logs: Path, diagnosed: Path
):
    given = ("before.mcap", "after.mcap")
    done = selfmodel("report", *given, *FEW, "--json", "-o", "a.html", cwd=logs)
    again = selfmodel(
        "report", *reversed(given), "--diagnosis", diagnosed.name, "-o", "again.html", cwd=logs
    )

    assert (done.returncode, again.returncode) == (0, 0), done.stderr + again.stderr
    told = json.loads(done.stdout)
    assert told["bytes"] == (logs / "a.html").stat().st_size
    assert told["headline"].startswith("1 trial of the quadruped. ")
    assert "quadruped: after" in (logs / "a.html").read_text()
    assert (logs / "again.html").read_bytes() == (logs / "a.html").read_bytes()
    assert "diagnostic EA" not in again.stderr


@pytest.mark.parametrize(
    ("given", "got"),
    [("nofolder", "got no such file or folder"), ("study/rows.csv", "got a file: give study")],
)
def test_what_is_neither_logs_nor_a_folder_is_refused(tmp_path: Path, given: str, got: str):
    (tmp_path / "study").mkdir()
    (tmp_path / "study" / "rows.csv").write_text("case\n1\n", encoding="utf-8")
    said = f"{given}: expected logs, NAME.mcap, or the folder of a run or of a study, {got}"
    refused("report", given, said=said, cwd=tmp_path)


def test_a_diagnosis_of_other_logs_is_refused(logs: Path, diagnosed: Path):
    (logs / "moved").mkdir()
    shutil.copy(logs / "before.mcap", logs / "moved" / "after.mcap")

    for given in (("after.mcap",), ("after.mcap", "moved/after.mcap", "before.mcap")):
        report = ("report", *given, "--diagnosis", diagnosed.name, "-o", "other.html")
        said = "is a diagnosis of other logs: expected after.mcap, before.mcap"
        refused(*report, said=said, cwd=logs)


def test_a_campaign_is_reported_into_its_folder(tmp_path: Path):
    (tmp_path / "results.csv").write_text("robot,correct\nquadruped,true\n")

    done = succeeds("report", str(tmp_path), cwd=tmp_path)

    assert "1 of 1 diagnoses are right" in done.stdout
    assert (tmp_path / "report.html").exists()


def test_a_file_that_appears_while_the_report_is_made_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    (tmp_path / "results.csv").write_text("robot,correct\nquadruped,true\n")
    command = import_module("selfmodel.cli.report")
    monkeypatch.setattr(command, "html_of", lambda report: _meanwhile(tmp_path, report))

    done = selfmodel("report", ".", "-o", "a.html", cwd=tmp_path)

    assert (done.returncode, done.stdout) == (1, "")
    assert "a.html was created meanwhile" in done.stderr
    assert "the finished report is a-2.html" in done.stderr
    assert (tmp_path / "a.html").read_text() == "of another"
    assert "1 of 1 diagnoses are right" in (tmp_path / "a-2.html").read_text()


def _meanwhile(folder: Path, report: Report) -> bytes:
    """The page of a report, while another program writes a file of that name."""
    (folder / "a.html").write_text("of another")
    return html_of(report)
