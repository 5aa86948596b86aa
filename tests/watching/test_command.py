"""``selfmodel watch``: JSON lines of a log, also while it is written."""

import json
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from mcap.writer import Writer

import selfmodel
from selfmodel.arguments import read_logs, robot_of_logs
from selfmodel.cli import watch
from selfmodel.errors import InputError
from selfmodel.logs import IncompleteError
from selfmodel.logs.records import TrialHeader
from selfmodel.logs.writer import TrialWriter, write_trial
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.trajectory import Sample, StepTiming, collect
from selfmodel.trials.trial import TrialPlan
from selfmodel.watching.record import AFTER, BLACK_BOX, FINDINGS
from tests.helpers.command import Done, refused, succeeds
from tests.logs.recordings.bags import storage
from tests.logs.recordings.driver import mapping, record
from tests.watching.conftest import stream, trial_of, walk

pytestmark = pytest.mark.search

STEPS = 500
Run = Callable[..., Done]


@pytest.fixture(scope="module")
def folder(
    tmp_path_factory: pytest.TempPathFactory, quadruped: Robot, healthy: list[Sample]
) -> Path:
    path = tmp_path_factory.mktemp("logs")
    selfmodel.write_log(trial_of(quadruped, healthy), path / "healthy.mcap", quadruped)
    return path


@pytest.fixture
def run(folder: Path) -> Run:
    """Runs the command on a log."""
    given = ("--healthy", "healthy.mcap", "--kinds", "body", "--no-calibrate")
    return lambda log, *options: succeeds("watch", str(log), *given, *options, cwd=folder)


def statuses(done: Done) -> list[str]:
    return [json.loads(line)["status"] for line in done.stdout.splitlines()]


@pytest.fixture(scope="module")
def failed(quadruped: Robot) -> list[Sample]:
    return stream(quadruped, "jam:back_right_knee=0.3", STEPS)


def test_the_findings_of_a_log_are_json_lines(
    run: Run, folder: Path, quadruped: Robot, failed: list[Sample]
):
    selfmodel.write_log(trial_of(quadruped, failed), folder / "failed.mcap", quadruped)
    done = run("failed.mcap")
    *_, last = map(json.loads, done.stdout.splitlines())

    assert statuses(done)[0] == "watching"
    assert last["status"] == "explained"
    assert last["remaining"][0]["hypothesis"].startswith("jam:back_right_knee")


@pytest.mark.parametrize("follow", [[], ["--follow"]])
def test_a_log_is_watched_to_its_end_or_to_that_of_the_watch(
    run: Run, folder: Path, quadruped: Robot, follow: list[str]
):
    steps = stream(quadruped, "intact", 100)
    selfmodel.write_log(trial_of(quadruped, steps), folder / f"{len(follow)}.mcap", quadruped)
    done = run(f"{len(follow)}.mcap", *follow)

    assert statuses(done) == ["watching"]
    assert "mcap: 100 steps" in done.stderr


def test_a_file_that_is_no_trial_log_is_refused_before_the_fit(run: Run, folder: Path):
    with (folder / "other.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/imu", "json", 0)
        writer.add_message(channel, 0, b"{}", 0)
        writer.finish()
    with pytest.raises(AssertionError, match=r"other\.mcap.*trial log"):
        run("other.mcap")


def test_a_log_that_is_written_is_followed_and_falling_behind_is_said(
    run: Run, folder: Path, quadruped: Robot, failed: list[Sample], monkeypatch: pytest.MonkeyPatch
):
    plan = TrialPlan("growing", "after", walk(quadruped, STEPS), STEPS, 0)
    with TrialWriter(folder / "growing.mcap", quadruped, plan, TrialHeader(Settings())) as writer:
        left = iter(failed)
        writer.add(next(left))
        unfinished = run("growing.mcap")

        def written_meanwhile(_seconds: float) -> None:
            """Writes 50 steps, and then 250."""
            for _ in range(50 if writer.steps == 1 else 250):
                writer.add(next(left))

        monkeypatch.setattr(watch.time, "sleep", written_meanwhile)
        followed = run("growing.mcap", "--follow")
        for step in left:
            writer.add(step)

    assert unfinished.stdout == ""
    assert "growing.mcap.part has no end: it is cut, or --follow waits" in unfinished.stderr
    assert statuses(followed)[-1] == "explained"
    assert followed.stderr.count("note: behind by 250 steps") == 1


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """A clock of the command, which goes on while it sleeps."""
    time = SimpleNamespace(now=0.0, monotonic=lambda: time.now)

    def sleep(seconds: float) -> None:
        time.now += seconds

    time.sleep = sleep
    monkeypatch.setattr(watch, "time", time)
    return time


def test_a_log_that_does_not_grow_is_stale_once_and_a_gap_is_no_change(
    run: Run, folder: Path, quadruped: Robot, healthy: list[Sample], clock: SimpleNamespace
):
    """The robot walks on for 5 s without a step in the log; the next one is late."""
    plan = TrialPlan("gap", "after", walk(quadruped, STEPS), STEPS, 0)
    steps = [
        replace(step, time=k * 0.01, moment=StepTiming(step.time, k == 250, False))
        for k, step in enumerate([*healthy[:250], *healthy[750:1000]])
    ]
    header, written, slept = TrialHeader(Settings(), timed=True), ExitStack(), clock.sleep
    writer = written.enter_context(TrialWriter(folder / "gap.mcap", quadruped, plan, header))
    for step in steps[:250]:
        writer.add(step)

    def written_meanwhile(seconds: float) -> None:
        slept(seconds)
        if clock.now >= 5.0:
            for step in steps[250:]:
                writer.add(step)
            written.close()

    clock.sleep = written_meanwhile
    done = run("gap.mcap", "--follow", "--out", "gap")
    said = [json.loads(line) for line in done.stdout.splitlines()]

    assert [one["status"] for one in said] == [
        *("watching", "stale", "watching", "not judged", "watching")
    ]
    assert [one["time"] for one in said[1:3]] == [2.0, 2.01]
    assert said[1]["reason"] == "no step for 2 s"
    assert said[3]["reason"] == "a step is late"
    assert [path.name for path in (folder / "gap").iterdir()] == [FINDINGS]


@pytest.mark.usefixtures("clock")
def test_a_folder_gets_the_findings_and_some_seconds_after_the_end_in_a_black_box(
    run: Run, folder: Path, quadruped: Robot
):
    steps = stream(quadruped, "jam:back_right_knee=0.3", 1000)
    selfmodel.write_log(trial_of(quadruped, steps), folder / "long.mcap", quadruped)
    done = run("long.mcap", "--out", "long")
    last = json.loads(done.stdout.splitlines()[-1])
    healthy, box = read_logs([folder / "healthy.mcap", folder / "long" / BLACK_BOX])

    assert last["status"] == "explained"
    assert f"black-box.mcap: {box.trial.trajectory.steps} steps from t = 0.00 s on" in done.stderr
    assert box.trial.trajectory.time[-1] == pytest.approx(last["time"] + AFTER)
    assert robot_of_logs([healthy, box], None).anatomy == quadruped.anatomy
    other = replace(box, mjcf=box.mjcf.replace('kp="60"', 'kp="61"'))
    with pytest.raises(InputError, match="of different models of the same name"):
        robot_of_logs([healthy, other], None)


@pytest.mark.usefixtures("clock")
def test_a_robot_that_stops_after_its_fault_is_not_waited_for(
    run: Run, folder: Path, quadruped: Robot, failed: list[Sample]
):
    plan = TrialPlan("stopped", "after", walk(quadruped, STEPS), STEPS, 0)
    path, header = folder / "stopped.mcap", TrialHeader(Settings())
    with pytest.raises(IncompleteError):
        write_trial(path, quadruped, plan, failed[:400], header)
    done = run("stopped.mcap", "--follow", "--out", "stopped")

    assert statuses(done)[-1] == "explained"
    assert (folder / "stopped" / BLACK_BOX).exists()


def test_a_recording_is_watched_by_its_mapping_also_while_it_grows(
    run: Run, folder: Path, quadruped: Robot, failed: list[Sample], monkeypatch: pytest.MonkeyPatch
):
    bag = record(folder / "bag", quadruped, collect(quadruped.anatomy.names, failed))
    (folder / "map.toml").write_text(mapping(quadruped, STEPS - 10, None))
    finished = run("bag", "--mapping", "map.toml")

    data, grown = storage(bag).read_bytes(), folder / "grown.mcap"
    grown.write_bytes(data[:50_000])
    size = len(data) // 20

    def written_meanwhile(_seconds: float) -> None:
        done = grown.stat().st_size
        grown.write_bytes(data[: done + size])

    monkeypatch.setattr(watch.time, "sleep", written_meanwhile)
    followed = run("grown.mcap", "--mapping", "map.toml", "--follow")

    assert statuses(finished)[-1] == "explained"
    assert "jam:back_right_knee" in finished.stdout.splitlines()[-1]
    assert followed.stdout == finished.stdout
    assert "note: not observed at all: joint_efforts" in finished.stderr
    assert "note" not in followed.stderr


def test_a_run_of_a_recording_is_one_of_a_finished_recording(folder: Path):
    said = "--run is for a finished recording: it needs --mapping, without --follow"
    for given in (["--run", "2"], ["--mapping", "map.toml", "--follow", "--run", "2"]):
        refused("watch", "a.mcap", "--healthy", "healthy.mcap", *given, said=said, cwd=folder)
