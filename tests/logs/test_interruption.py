import errno
import io
import os
import resource
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from selfmodel.errors import InputError
from selfmodel.logs import IncompleteError, LogWriteError, TruncatedError, log_file, read_log
from selfmodel.logs.log_file import read_undamaged
from selfmodel.logs.messages import topics
from selfmodel.logs.records import TrialHeader
from selfmodel.logs.writer import FLUSH_STEPS, write_trial
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.behaviour import Sample
from tests.logs.conftest import STEPS, made_up, plan_of

SCRIPT = """
import sys, time
from pathlib import Path
from selfmodel.logs.records import TrialHeader
from selfmodel.logs.writer import write_trial
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from tests.logs.conftest import MJCF, made_up, plan_of

robot = Robot("biped", MJCF, 0.01)
stop_at = int(sys.argv[2])

def samples():
    for k, sample in enumerate(made_up(robot, 1000)):
        if k == stop_at:
            print("there", flush=True)
            time.sleep(60)
        yield sample

write_trial(Path(sys.argv[1]), robot, plan_of(robot, 1000), samples(), TrialHeader(Settings()))
"""


def steps_kept(part: Path, robot: Robot) -> int:
    """How many steps an unfinished file holds whole, having checked that they are the true ones."""
    with pytest.raises(TruncatedError, match="selfmodel logs salvage"):
        read_log(part)
    contents = read_undamaged(part)[0]
    assert set(contents.attachments) == {"model.xml", "controller.npz", "settings.json"}
    for topic in topics(robot.anatomy.names, robot.root):
        messages = contents.topics[topic.name]
        _, values = topic.template.decode(messages.payloads)
        rows = topic.unpack(values)
        for k, sample in enumerate(made_up(robot, len(values))):
            for name in set(rows) & set(sample.values):
                assert rows[name][k].tobytes() == sample.values[name].tobytes()
    return len(messages.payloads)


def stopping(robot: Robot, at: int, error: BaseException) -> Iterator[Sample]:
    for k, sample in enumerate(made_up(robot, STEPS)):
        if k == at:
            raise error
        yield sample


@pytest.mark.parametrize("error", [RuntimeError("the robot fell off"), KeyboardInterrupt()])
@pytest.mark.parametrize("at", [1, 50, 77])
def test_what_ends_a_trial_passes_on_and_every_step_until_then_stays(
    biped: Robot, tmp_path: Path, error: BaseException, at: int
):
    path = tmp_path / "a.mcap"
    samples = stopping(biped, at, error)
    with pytest.raises(type(error)) as caught:
        write_trial(path, biped, plan_of(biped, STEPS), samples, TrialHeader(Settings()))
    assert caught.value is error
    assert [file.name for file in tmp_path.iterdir()] == ["a.mcap.part"]
    assert steps_kept(tmp_path / "a.mcap.part", biped) == at


def test_a_trial_that_ends_before_its_first_step_leaves_what_was_planned(
    biped: Robot, tmp_path: Path
):
    with pytest.raises(RuntimeError, match="gone"):
        write_trial(
            tmp_path / "a.mcap",
            biped,
            plan_of(biped, STEPS),
            stopping(biped, 0, RuntimeError("gone")),
            TrialHeader(Settings()),
        )
    contents = read_undamaged(tmp_path / "a.mcap.part")[0]
    assert contents.metadata["selfmodel.trial"]["name"] == "00-before"


@pytest.mark.parametrize("at", [60, 149, 150, 423])
def test_a_kill_costs_at_most_the_steps_of_one_flush(biped: Robot, tmp_path: Path, at: int):
    process = subprocess.Popen(
        [sys.executable, "-c", SCRIPT, tmp_path / "a.mcap", str(at)],
        cwd=Path(__file__).parents[2],
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "there\n"
    finally:
        process.send_signal(signal.SIGKILL)
        process.communicate()
    assert [file.name for file in tmp_path.iterdir()] == ["a.mcap.part"]
    assert at - FLUSH_STEPS < steps_kept(tmp_path / "a.mcap.part", biped) <= at


def test_a_robot_that_stops_early_has_not_finished(biped: Robot, tmp_path: Path):
    path = tmp_path / "a.mcap"
    samples = made_up(biped, 70)
    with pytest.raises(IncompleteError, match=r"a\.mcap\.part: the robot stopped after 70 of 120"):
        write_trial(path, biped, plan_of(biped, STEPS), samples, TrialHeader(Settings()))
    assert not path.exists()
    assert steps_kept(tmp_path / "a.mcap.part", biped) == 70
    with pytest.raises(TruncatedError, match="selfmodel logs salvage"):
        read_log(tmp_path / "a.mcap.part")


@pytest.mark.parametrize("name", ["a.mcap", "a.mcap.part"])
def test_an_existing_file_is_neither_overwritten_nor_run_for(
    biped: Robot, tmp_path: Path, name: str
):
    (tmp_path / name).write_text("precious")
    with pytest.raises(InputError, match=rf"{name} exists, and is not overwritten"):
        write_trial(
            tmp_path / "a.mcap",
            biped,
            plan_of(biped, STEPS),
            stopping(biped, 0, AssertionError("the robot was run")),
            TrialHeader(Settings()),
        )
    assert [file.name for file in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_text() == "precious"


def test_a_file_that_comes_to_exist_meanwhile_is_not_overwritten(biped: Robot, tmp_path: Path):
    path = tmp_path / "a.mcap"

    def samples() -> Iterator[Sample]:
        yield from made_up(biped, STEPS)
        raise AssertionError("too many samples were asked for")

    def intruding() -> Iterator[Sample]:
        for k, sample in enumerate(samples()):
            if k == 5:
                path.write_text("precious")
            yield sample

    with pytest.raises(InputError, match=r"the finished file is .*a\.mcap\.part"):
        write_trial(path, biped, plan_of(biped, STEPS), intruding(), TrialHeader(Settings()))
    assert path.read_text() == "precious"
    assert read_log(tmp_path / "a.mcap.part").status == "finished"


def test_a_folder_that_is_not_there_is_said_so(biped: Robot, tmp_path: Path):
    path = tmp_path / "no" / "a.mcap"
    with pytest.raises(InputError, match="there is no folder"):
        write_trial(path, biped, plan_of(biped, 1), made_up(biped, 1), TrialHeader(Settings()))


class FullDisk(io.FileIO):
    """A file on a disk that has room for so many bytes."""

    room = 0

    def write(self, data: bytes | memoryview) -> int:
        """Writes, while there is room."""
        size = memoryview(data).nbytes
        if self.room < size:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        self.room -= size
        return super().write(data) or 0


@pytest.mark.parametrize("share", [0.0, 0.05, 0.3, 0.9, 0.999])
def test_a_full_disk_is_said_as_such_with_the_name_of_the_file(
    biped: Robot, log: Path, monkeypatch: pytest.MonkeyPatch, share: float
):
    room, folder = int(share * log.stat().st_size), log.parent / "full"
    folder.mkdir()

    def opened(path: Path, mode: str) -> io.BufferedWriter:
        raw = FullDisk(path, mode)
        raw.room = room
        return io.BufferedWriter(raw)

    monkeypatch.setattr(Path, "open", opened)
    plan = plan_of(biped, STEPS)
    with pytest.raises(LogWriteError, match=r"a\.mcap\.part: the disk is full") as caught:
        write_trial(
            folder / "a.mcap",
            biped,
            plan,
            made_up(biped, STEPS),
            TrialHeader(Settings(), hidden="intact"),
        )
    assert caught.value.errno == errno.ENOSPC
    assert [file.name for file in folder.iterdir()] == ["a.mcap.part"]


def test_a_size_limit_is_said_as_such_with_the_name_of_the_file(tmp_path: Path):
    result = subprocess.run(
        [sys.executable, "-c", SCRIPT, tmp_path / "a.mcap", "2000"],
        check=False,
        capture_output=True,
        cwd=Path(__file__).parents[2],
        text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, 60_000)),
    )
    assert "LogWriteError" in result.stderr
    assert "a.mcap.part: the file has reached the size that this system allows" in result.stderr
    assert [file.name for file in tmp_path.iterdir()] == ["a.mcap.part"]


def test_a_disk_that_fills_while_a_trial_is_interrupted_does_not_hide_why(
    biped: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def fail(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def samples() -> Iterator[Sample]:
        yield from made_up(biped, 20)
        monkeypatch.setattr(log_file.Writer, "add_message", fail)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as caught:
        write_trial(
            tmp_path / "a.mcap", biped, plan_of(biped, STEPS), samples(), TrialHeader(Settings())
        )
    assert "the disk is full" in caught.value.__notes__[0]
