"""Each stage of a long command shows how far it is, and the time left, on a terminal and off it."""

import io
import re
import sys
from collections import defaultdict
from dataclasses import replace
from pathlib import Path

import pytest

import selfmodel
from selfmodel import progress as times
from selfmodel.cli import progress
from selfmodel.evolution import Generation
from selfmodel.progress import Progress
from selfmodel.recovery.result import Event, SearchBegins
from selfmodel.robot.robot import Robot

LOG = Path(__file__).parents[1] / "data" / "logs-0.1" / "recovery" / "trials" / "00-before.mcap"
"""A trial of a healthy robot."""

EVENTS: tuple[tuple[float, Event], ...] = (
    (0.0, Progress("calibration", 0, 160)),
    (4.0, Progress("calibration", 40, 160)),
    (12.0, Progress("calibration", 80, 160)),
    (24.0, Progress("calibration", 160, 160)),
    (24.0, SearchBegins("diagnostic")),
    (34.0, Generation(10, 30, -0.25, 300, 10.0)),
    (54.0, Generation(30, 30, -0.125, 900, 30.0)),
    (55.0, Progress("refinement", 0, 3)),
    (175.0, Progress("refinement", 1, 3)),
    (176.0, Progress("refinement", 3, 3)),
)
"""Times, s, and events."""


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The time that the display reads, s."""
    now = [0.0]
    monkeypatch.setattr(progress, "monotonic", lambda: now[0])
    monkeypatch.setattr(times, "perf_counter", lambda: now[0])
    return now


def test_in_a_file_a_stage_is_a_line_now_and_then_with_the_time_left(
    clock: list[float], capsys: pytest.CaptureFixture[str]
):
    with progress.display() as on_event:
        for clock[0], event in EVENTS:
            on_event(event)
    told = capsys.readouterr()

    assert told.out == ""
    assert told.err.splitlines() == [
        "calibration: 50%, about 12 s left",
        "diagnostic EA: 33%, about 20 s left",
        "diagnostic EA: 900 evaluations, best -0.1250, 30/s",
        "refinement: 33%, about 4 min 00 s left",
    ]


def test_the_line_of_a_trial_has_its_way_and_its_fall(
    quadruped: Robot, capsys: pytest.CaptureFixture[str]
):
    trial = selfmodel.read_log(LOG).trial
    logged = trial.trajectory
    turned = dict(logged.signals, base_orientation=logged["base_orientation"].copy())
    turned["base_orientation"][30:] = [0.0, 1.0, 0.0, 0.0]
    fell = replace(trial, trajectory=replace(logged, signals=turned))
    with progress.display(quadruped) as on_event:
        on_event(trial)
        on_event(fell)
    went = f"trial 00-before: {trial.displacement:.3f} m forward"
    assert capsys.readouterr().err.splitlines() == [went, f"{went}, fell at step 30"]


def test_on_a_terminal_a_stage_is_a_bar_with_the_time_left(
    clock: list[float], monkeypatch: pytest.MonkeyPatch
):
    screen = io.StringIO()
    monkeypatch.setattr(screen, "isatty", lambda: True)
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setenv("TERM", "xterm")
    with progress.display() as on_event:
        for clock[0], event in EVENTS:
            on_event(event)
            on_event.bar.refresh()
    shown = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", screen.getvalue())

    assert re.search(r"calibration .*━.* 50 % about 12 s left", shown)
    assert re.search(r"diagnostic EA .*━.* 33 % best -0.2500, 30/s, about 20 s left", shown)
    assert re.search(r"refinement .*━.* 33 % about 4 min 00 s left", shown)


@pytest.mark.search
@pytest.mark.usefixtures("coarse_calibration")
def test_calibration_refinement_and_detectable_severities_report_from_their_start_to_their_end():
    shares = defaultdict[str, list[float]](list)

    def observe(event: Event) -> None:
        if isinstance(event, Progress):
            shares[event.stage].append(event.done / event.total)

    trial = selfmodel.read_log(LOG).trial
    settings = selfmodel.Settings(generations=1).scaled(4)
    given = {"robot": "quadruped", "kinds": "motor", "settings": settings, "threads": 1}
    selfmodel.diagnose(trial, healthy=LOG, **given, on_event=observe)

    for stage in ("calibration", "refinement", "detectable severities"):
        assert shares[stage] == sorted(shares[stage]), stage
        assert shares[stage][-1] == 1.0, stage
        assert len(shares[stage]) > 2, stage


def test_printed_events_are_lines_with_the_time_left(
    clock: list[float], capsys: pytest.CaptureFixture[str]
):
    on_event = times.timed(print)
    for clock[0], event in EVENTS[1:7]:
        on_event(event)

    assert capsys.readouterr().out.splitlines() == [
        "calibration: 25%",  # it began unseen
        "calibration: 50%, about 8 s left",
        "calibration: 100%",
        "diagnostic EA",
        "300 evaluations, best -0.2500, 30/s, about 20 s left",
        "900 evaluations, best -0.1250, 30/s",
    ]
