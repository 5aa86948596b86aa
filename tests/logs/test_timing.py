"""Promises of the clock in a log, and that a trial of a robot with a clock is stopped whole."""

import errno
import os
from collections.abc import Generator, Iterator
from pathlib import Path

import numpy as np
import pytest

from selfmodel.errors import InputError
from selfmodel.logs import LogError, SchemaMismatchError, UnsupportedError, log_file, read_log
from selfmodel.logs.log_file import read_contents
from selfmodel.logs.messages import TIMING
from selfmodel.logs.records import MAX_TEXT, RESULT, TRIAL, TrialHeader
from selfmodel.logs.salvage import salvage
from selfmodel.logs.writer import write_trial
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.behaviour import Sample, collect
from selfmodel.trials.signals import SIGNALS
from tests.logs.conftest import STEPS, made_up, plan_of, timed
from tests.logs.edits import rewritten, says


def write(path: Path, robot: Robot, samples: Iterator[Sample], **options: object) -> Path:
    plan = plan_of(robot, STEPS)
    return write_trial(path, robot, plan, samples, TrialHeader(Settings(), **options))


@pytest.fixture
def clocked(biped: Robot, tmp_path: Path) -> Path:
    """A finished log of a made-up trial with a clock."""
    return write(tmp_path / "clocked.mcap", biped, timed(made_up(biped, STEPS)), timed=True)


def test_the_clock_comes_back_to_the_bit(biped: Robot, clocked: Path):
    read = read_log(clocked)
    moments = [sample.moment for sample in timed(made_up(biped, STEPS))]

    assert read.timing is not None
    assert read.timing.elapsed.tolist() == [moment.elapsed for moment in moments]
    assert read.timing.late.tolist() == [moment.late for moment in moments]
    assert read.timing.missing.tolist() == [moment.missing for moment in moments]
    assert np.array_equal(read.trial.behaviour.late, read.timing.late)
    live = collect(biped.anatomy.names, timed(made_up(biped, STEPS)))
    assert np.array_equal(read.trial.behaviour.late, live.late)
    assert all(read.trial.behaviour[s].tobytes() == live[s].tobytes() for s in SIGNALS)


def test_without_a_clock_a_log_is_what_it_was(log: Path):
    read = read_log(log)

    assert (read.timing, read.trial.behaviour.late, read.reason) == (None, None, "")
    contents = read_contents(log)
    assert contents.metadata[TRIAL]["format"] == "1"
    assert TIMING.name not in contents.topics
    assert set(contents.metadata[RESULT]) == {"status", "steps", "displacement"}


@pytest.mark.parametrize("has", [True, False])
def test_samples_with_and_without_a_clock_do_not_mix(biped: Robot, tmp_path: Path, *, has: bool):
    samples = made_up(biped, STEPS)
    with pytest.raises(InputError, match=r"the sample of step 0 has (a|no) moment"):
        write(tmp_path / "a.mcap", biped, timed(samples) if has else samples, timed=not has)


@pytest.mark.parametrize(
    ("column", "value", "match"),
    [
        (0, 0.0, "seconds that never go back"),
        (0, np.inf, "seconds that never go back"),
        (1, 0.5, "0 or 1 for late and for missing"),
        (2, -1.0, "0 or 1 for late and for missing"),
    ],
)
def test_a_clock_that_cannot_be_is_refused(
    clocked: Path, column: int, value: float, match: str, monkeypatch: pytest.MonkeyPatch
):
    def decode(template: object, payloads: list[bytes]) -> tuple[np.ndarray, np.ndarray]:
        stamps, values = original(template, payloads)
        if template is TIMING.template:
            values = values.copy()
            values[60, column] = value
        return stamps, values

    original = type(TIMING.template).decode
    monkeypatch.setattr(type(TIMING.template), "decode", decode)
    with pytest.raises(SchemaMismatchError, match=f"on /timing: expected {match}"):
        read_log(clocked)


def test_a_step_at_the_same_time_as_the_one_before_is_read(biped: Robot, tmp_path: Path):
    samples = list(timed(made_up(biped, STEPS)))
    samples[60] = Sample(samples[60].time, samples[60].values, samples[59].moment)
    write(tmp_path / "a.mcap", biped, iter(samples), timed=True)

    assert read_log(tmp_path / "a.mcap").status == "finished"


class FallError(Exception):
    """What a robot may end with."""


def stopped(robot: Robot, at: int, error: BaseException) -> Iterator[Sample]:
    for k, sample in enumerate(timed(made_up(robot, STEPS))):
        if k == at:
            raise error
        yield sample


@pytest.mark.parametrize("error", [FallError("the leg\n came  off"), KeyboardInterrupt()])
@pytest.mark.parametrize("at", [1, 50, 51, 119])
def test_a_trial_with_a_clock_that_is_stopped_is_a_whole_log(
    biped: Robot, tmp_path: Path, error: BaseException, at: int
):
    with pytest.raises(type(error)) as caught:
        write(tmp_path / "a.mcap", biped, stopped(biped, at, error), timed=True)
    log = read_log(tmp_path / "a.mcap")

    assert caught.value is error
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap"]
    assert (log.status, log.trial.behaviour.steps) == ("stopped", at)
    expected = {FallError: "FallError: the leg came off", KeyboardInterrupt: "KeyboardInterrupt"}
    assert log.reason == expected[type(error)]
    with pytest.raises(InputError, match="the trial in it is stopped"):
        salvage(tmp_path / "a.mcap", tmp_path / "b.mcap")


def test_a_reason_may_be_long(biped: Robot, tmp_path: Path):
    with pytest.raises(FallError):
        write(tmp_path / "a.mcap", biped, stopped(biped, 9, FallError("x" * 9999)), timed=True)

    assert len(read_log(tmp_path / "a.mcap").reason) == MAX_TEXT


def test_a_reason_that_is_no_text_does_not_cost_the_log(biped: Robot, tmp_path: Path):
    with pytest.raises(FallError):
        write(tmp_path / "a.mcap", biped, stopped(biped, 9, FallError("/dev/\udcff")), timed=True)

    assert read_log(tmp_path / "a.mcap").reason == r"FallError: /dev/\udcff"


def test_a_reason_that_is_too_long_is_refused(clocked: Path):
    rewritten(clocked, says(RESULT, reason="x" * (MAX_TEXT + 1)))
    with pytest.raises(SchemaMismatchError, match="reason"):
        read_log(clocked)


def test_a_trial_that_stops_before_its_first_step_has_no_log(biped: Robot, tmp_path: Path):
    with pytest.raises(FallError):
        write(tmp_path / "a.mcap", biped, stopped(biped, 0, FallError()), timed=True)

    assert list(tmp_path.iterdir()) == []
    write(tmp_path / "a.mcap", biped, timed(made_up(biped, STEPS)), timed=True)


def test_ctrl_c_while_steps_are_written_leaves_what_can_be_salvaged(
    biped: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    def samples() -> Iterator[Sample]:
        for k, sample in enumerate(timed(made_up(biped, STEPS))):
            if k == 50:  # the next one is written with the 49 before
                monkeypatch.setattr(log_file.LogFile, "messages", interrupt)
            yield sample

    with pytest.raises(KeyboardInterrupt):
        write(tmp_path / "a.mcap", biped, samples(), timed=True)
    monkeypatch.undo()
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap.part"]
    assert salvage(tmp_path / "a.mcap.part", tmp_path / "b.mcap").steps == 1


def test_a_disk_that_is_full_as_a_trial_is_stopped_does_not_hide_why(
    biped: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def fail(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def samples() -> Iterator[Sample]:
        yield from timed(made_up(biped, 20))
        monkeypatch.setattr(log_file.LogFile, "metadata", fail)
        raise FallError

    with pytest.raises(FallError) as caught:
        write(tmp_path / "a.mcap", biped, samples(), timed=True)
    assert os.strerror(errno.ENOSPC) in caught.value.__notes__[0]
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap.part"]


def test_a_file_that_comes_to_exist_as_a_trial_is_stopped_does_not_hide_why(
    biped: Robot, tmp_path: Path
):
    def samples() -> Iterator[Sample]:
        yield from timed(made_up(biped, 20))
        (tmp_path / "a.mcap").write_text("precious")
        raise FallError

    with pytest.raises(FallError) as caught:
        write(tmp_path / "a.mcap", biped, samples(), timed=True)
    assert "is not overwritten" in caught.value.__notes__[0]
    assert (tmp_path / "a.mcap").read_text() == "precious"


def test_a_status_that_nobody_knows_is_refused(clocked: Path):
    rewritten(clocked, says(RESULT, status="paused"))
    with pytest.raises(UnsupportedError, match="the trial is 'paused'"):
        read_log(clocked)


class Wrapped:
    """Samples that are looked at on their way; no generator."""

    def __init__(self, samples: Generator[Sample]) -> None:
        self.samples = samples

    def __iter__(self) -> Iterator[Sample]:
        """Returns the samples."""
        return self.samples

    def close(self) -> None:
        """Closes the samples."""
        self.samples.close()


def test_the_robot_stops_before_the_log_is_closed(biped: Robot, tmp_path: Path):
    order = []

    def samples(name: str) -> Iterator[Sample]:
        try:
            yield from made_up(biped, STEPS)
            yield Sample(-1.0, {})  # nobody asks for it
        finally:
            order.append((tmp_path / name).exists())

    write(tmp_path / "a.mcap", biped, samples("a.mcap"))
    write(tmp_path / "c.mcap", biped, Wrapped(samples("c.mcap")))
    assert order == [False, False]
    with pytest.raises(LogError):
        read_log(write(tmp_path / "b.mcap", biped, iter([])))
