import subprocess
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from time import monotonic, sleep

import pytest

from selfmodel.evolution import Generation
from selfmodel.faults.hypothesis import INTACT
from selfmodel.recovery.events import SearchBegins
from selfmodel.report.live.live_report import LiveReport, live_report
from selfmodel.report.subject import Subject
from tests.helpers.browser import built
from tests.helpers.command import SMALL, selfmodel

pytestmark = built


@pytest.fixture
def live(run: Path) -> Iterator[LiveReport]:
    with live_report(run, "quadruped: run", lambda _url: None) as found:
        yield found


def test_before_the_first_diagnosis_the_page_has_the_searches(live: LiveReport):
    live(SearchBegins("repair", INTACT))
    live(Generation(1, 2, 0.125, 20, 1.0))
    live(SearchBegins("diagnostic"))

    page = live.shown.page.decode()
    assert "The recovery goes on: a diagnosis begins." in page
    assert "0.125" in page


def test_the_line_follows_the_generations(live: LiveReport):
    live(SearchBegins("repair", INTACT))
    live(Generation(1, 2, 0.125, 20, 1.0))
    assert live.shown.line == "generation 1 of 2, best fitness 0.125."
    live(Generation(1, 2, float("-inf"), 20, 1.0))
    assert live.shown.line == "generation 1 of 2, best fitness none."


def test_a_report_that_cannot_be_made_does_not_end_the_recovery(
    live: LiveReport, subject: Subject, monkeypatch: pytest.MonkeyPatch
):
    def refused(*_arguments: object, **_options: object) -> None:
        raise OSError("no memory")

    monkeypatch.setattr(subprocess, "Popen", refused)

    live(subject.diagnosis)

    assert live.maker is None
    assert live.shown.line.startswith("diagnosis ")


@pytest.mark.process
def test_a_diagnosis_makes_a_report_beside_the_recovery(live: LiveReport, subject: Subject):
    live(subject.diagnosis)
    end = monotonic() + 60
    while not live.has_report and monotonic() < end:
        sleep(0.2)
        live(Generation(1, 2, 0.5, 20, 1.0))

    assert live.has_report
    assert "The quadruped moved" in live.shown.page.decode()
    assert live.maker is None


@pytest.mark.process
def test_the_process_that_makes_a_report_ends_with_the_recovery(run: Path, subject: Subject):
    with live_report(run, "quadruped: run", lambda _url: None) as live:
        live(subject.diagnosis)
        maker = live.maker
        assert isinstance(maker, subprocess.Popen)

    assert maker.poll() is not None


def test_the_last_page_waits_for_no_browser_that_is_not_open(live: LiveReport):
    begin = monotonic()

    live.finish(b"<body>last")

    assert monotonic() - begin < 1
    assert live.shown.status() == {
        "version": live.shown.version,
        "line": "The recovery has ended; this report is in its folder.",
        "running": False,
    }


@pytest.mark.process
def test_an_open_browser_gets_the_last_page(run: Path):
    addresses: list[str] = []
    with live_report(run, "quadruped: run", addresses.append) as live:
        with urllib.request.urlopen(addresses[0], timeout=10) as answer:  # noqa: S310  # ours
            assert b"data-version" in answer.read()
        begin = monotonic()
        live.finish(b"<body>last")
        assert monotonic() - begin >= 4  # no request came for it


@pytest.mark.search
def test_a_recovery_with_a_report_computes_the_same_and_leaves_the_report(
    run: Path, tmp_path: Path
):
    arguments = ("--case", "2", *SMALL, "--steps", "60", "--trials", "1", "--gap", "0.1")
    done = selfmodel("recover", "quadruped", *arguments, "--report", "--out", "r", cwd=tmp_path)

    assert done.returncode == 0, done.stderr
    assert "report: http://127.0.0.1:" in done.stderr
    assert (tmp_path / "r" / "report.html").stat().st_size > 100_000
    assert (tmp_path / "r" / "diagnoses.json").read_bytes() == (run / "diagnoses.json").read_bytes()
    assert (tmp_path / "r" / "searches.json").read_bytes() == (run / "searches.json").read_bytes()
