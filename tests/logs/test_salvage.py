"""Salvage: the steps before the first damage are saved, and the original is left alone."""

import io
from pathlib import Path

import pytest
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from mcap.writer import Writer

from selfmodel.errors import InputError
from selfmodel.logs import LogError, LogWriteError, read_log, read_truth
from selfmodel.logs.log_file import read_contents
from selfmodel.logs.records import SALVAGE, TrialHeader, sha256
from selfmodel.logs.salvage import salvage, salvageable_steps
from selfmodel.logs.writer import write_trial
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trial import TrialPlan
from tests.logs.conftest import STEPS, full, made_up, timed

FLUSHED = (0, 1, 51, 101, STEPS)
"""Steps after each chunk of the log."""


@pytest.fixture
def saved(log: Path) -> Path:
    return log.with_name("saved.mcap")


def chunks_of(data: bytes | bytearray) -> list[Chunk]:
    """The chunks of a log."""
    records = StreamReader(io.BytesIO(data), emit_chunks=True).records
    return [record for record in records if isinstance(record, Chunk)]


def spoilt_chunk(log: Path, number: int) -> None:
    """Flips a bit in a chunk."""
    data = bytearray(log.read_bytes())
    data[data.index(chunks_of(data)[number].data) + 60] ^= 1
    log.write_bytes(data)


@pytest.mark.parametrize("number", [1, 2, 3, 4])
@pytest.mark.parametrize("cut", [True, False])
def test_the_steps_before_the_first_damage_are_saved(
    log: Path, saved: Path, number: int, *, cut: bool
):
    true = read_log(log)
    spoilt_chunk(log, number)
    if cut:
        data = log.read_bytes()
        chunk = chunks_of(data)[number]
        log.write_bytes(data[: data.index(chunk.data) + len(chunk.data) + 200])
    if number == 1:
        with pytest.raises(LogError, match=r"nothing can be salvaged before its first damage: "):
            salvage(log, saved)
        assert salvageable_steps(log) == 0
        return
    result = salvage(log, saved)
    found = read_log(saved)

    steps = FLUSHED[number - 1]
    assert (result.steps, result.planned) == (steps, STEPS)
    assert salvageable_steps(log) == steps
    assert (found.status, found.trial.plan) == ("interrupted", true.trial.plan)
    for signal in SIGNALS:
        expected = true.trial.trajectory[signal][:steps]
        assert found.trial.trajectory[signal].tobytes() == expected.tobytes()


def test_a_timed_trial_with_meshes_keeps_its_clock_and_its_files(
    biped: Robot, plan: TrialPlan, tmp_path: Path
):
    robot = Robot("biped", biped.mjcf, biped.control_timestep, {"mesh.stl": bytes(100)})
    log, saved = tmp_path / "trial.mcap", tmp_path / "saved.mcap"
    write_trial(log, robot, plan, timed(made_up(biped, STEPS)), TrialHeader(Settings(), timed=True))
    before = read_log(log)
    log.write_bytes(log.read_bytes()[:-20])
    result = salvage(log, saved)
    found = read_log(saved)

    assert (result.steps, found.assets) == (STEPS, {"mesh.stl": bytes(100)})
    assert before.timing is not None
    assert found.timing is not None
    assert found.timing.elapsed.tobytes() == before.timing.elapsed.tobytes()


def test_the_original_is_left_alone_and_the_truth_goes_along_unseen(log: Path, saved: Path):
    spoilt_chunk(log, 3)
    before = log.read_bytes(), log.stat().st_mtime_ns
    salvage(log, saved)

    assert (log.read_bytes(), log.stat().st_mtime_ns) == before
    assert read_truth(saved) == "intact"
    assert read_contents(saved).metadata[SALVAGE] == {
        "source": "trial.mcap",
        "source_sha256": sha256(before[0]),
        "complete_steps": "51",
    }


def test_a_sound_log_is_not_salvaged(log: Path, saved: Path):
    with pytest.raises(InputError, match="is valid, and the trial in it is finished: there"):
        salvage(log, saved)
    spoilt_chunk(log, 3)
    salvage(log, saved)
    with pytest.raises(InputError, match="the trial in it is interrupted"):
        salvage(saved, log.with_name("again.mcap"))


def test_a_disk_that_fills_leaves_no_half_of_a_log(
    log: Path, saved: Path, monkeypatch: pytest.MonkeyPatch
):
    spoilt_chunk(log, 3)
    monkeypatch.setattr(Writer, "add_message", full)
    with pytest.raises(LogWriteError, match="the disk is full"):
        salvage(log, saved)
    assert [path.name for path in log.parent.iterdir()] == ["trial.mcap"]
