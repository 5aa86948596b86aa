"""A log that is read while it is written: each step once, as soon as it is on the disk."""

from contextlib import ExitStack, closing
from pathlib import Path

import numpy as np
import pytest

from selfmodel.errors import InputError
from selfmodel.logs import CorruptError, NotMcapError
from selfmodel.logs.growing import GrowingLog
from selfmodel.logs.records import Imported, TrialHeader
from selfmodel.logs.writer import FLUSH_STEPS, TrialWriter, write_trial
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.signals import SIGNALS, Names
from selfmodel.trials.trajectory import Sample
from tests.logs.conftest import STEPS, made_up, plan_of, timed


def assert_equal(found: list[Sample], expected: list[Sample]) -> None:
    assert [one.time for one in found] == [one.time for one in expected]
    assert [one.moment for one in found] == [one.moment for one in expected]
    for signal in SIGNALS:
        for one, other in zip(found, expected, strict=True):
            assert np.array_equal(one.values[signal], other.values[signal], equal_nan=True)


@pytest.mark.parametrize("clock", [False, True])
def test_each_step_is_read_once_as_soon_as_it_is_written(
    tmp_path: Path, biped: Robot, *, clock: bool
):
    steps = list(timed(made_up(biped, STEPS)) if clock else made_up(biped, STEPS))
    path, read = tmp_path / "a.mcap", list[Sample]()
    header, written = TrialHeader(Settings(), timed=clock), ExitStack()
    writer = written.enter_context(TrialWriter(path, biped, plan_of(biped, STEPS), header))
    with closing(GrowingLog(path, biped.anatomy.names)) as growing:
        assert growing.path.suffix == ".part"
        for count, step in enumerate(steps, start=1):
            writer.add(step)
            read += growing.new_steps()
            assert len(read) == 1 + (count - 1) // FLUSH_STEPS * FLUSH_STEPS
        assert not growing.has_ended
        written.close()
        read += growing.new_steps()

        assert growing.has_ended
    assert_equal(read, steps)


@pytest.mark.parametrize("start", [0, 1_700_000_000_123_456_789])
def test_the_time_stamp_of_the_first_step_is_that_of_the_recording(
    tmp_path: Path, biped: Robot, start: int
):
    imported = Imported({"start": str(start)}, "") if start else None
    header, steps = TrialHeader(Settings(), imported=imported), made_up(biped, STEPS)
    path = write_trial(tmp_path / "a.mcap", biped, plan_of(biped, STEPS), steps, header)
    with closing(GrowingLog(path, biped.anatomy.names)) as growing:
        growing.new_steps()
        assert growing.start == start


def test_a_log_that_is_cut_anywhere_grows_to_the_same_steps(
    tmp_path: Path, log: Path, biped: Robot
):
    data, part, read = log.read_bytes(), tmp_path / "b.mcap.part", list[Sample]()
    part.write_bytes(data[:8])
    with (
        closing(GrowingLog(tmp_path / "b.mcap", biped.anatomy.names)) as growing,
        part.open("ab") as file,
    ):
        for begin in range(8, len(data), 997):
            file.write(data[begin : begin + 997])
            file.flush()
            read += growing.new_steps()
    with closing(GrowingLog(log, biped.anatomy.names)) as finished:
        assert_equal(read, finished.new_steps())
    assert len(read) == STEPS


def test_a_damaged_chunk_a_log_of_another_robot_and_no_log_are_refused(
    tmp_path: Path, log: Path, biped: Robot
):
    names, bad = biped.anatomy.names, tmp_path / "bad.mcap"
    data = bytearray(log.read_bytes())
    data[len(data) // 2] ^= 0x10
    bad.write_bytes(data)
    with (
        closing(GrowingLog(bad, names)) as growing,
        pytest.raises(CorruptError, match="logs salvage"),
    ):
        growing.new_steps()
    other = Names(names.sensors, names.motors, ("left_hip_x",))
    with (
        closing(GrowingLog(log, other)) as growing,
        pytest.raises(InputError, match="of another robot"),
    ):
        growing.new_steps()
    bad.write_text("nothing")
    with closing(GrowingLog(bad, names)) as growing, pytest.raises(NotMcapError):
        growing.new_steps()
    with pytest.raises(InputError, match="finished or being written"):
        GrowingLog(tmp_path / "none.mcap", names)
