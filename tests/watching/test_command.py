"""``selfmodel watch``: JSON lines of a log, also while it is written."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from mcap.writer import Writer

import selfmodel
from selfmodel.cli import watch
from selfmodel.logs.records import TrialHeader
from selfmodel.logs.writer import TrialWriter
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.trajectory import Sample, collect
from selfmodel.trials.trial import TrialPlan
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
