"""Promises of salvage: what is whole is saved, nothing is made up, the original is left alone."""

import contextlib
import dataclasses
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.writer import Writer

from selfmodel.controllers.controller import Controller
from selfmodel.controllers.playback import Playback
from selfmodel.errors import InputError
from selfmodel.logs import LogError, LogWriteError, read_log, read_truth
from selfmodel.logs.mcap.contents import read_contents
from selfmodel.logs.mcap.framing import FRAME, frames
from selfmodel.logs.messages.topics import TRANSFORMS, TRANSFORMS_TYPE
from selfmodel.logs.records import HIDDEN, RESULT, SALVAGE, TrialHeader, sha256
from selfmodel.logs.salvage import salvage, salvageable_steps
from selfmodel.logs.writing.writer import write_trial
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trial import TrialPlan
from tests.fuzz.mcap_file import read_file, written
from tests.fuzz.seal import seal
from tests.logs.conftest import STEPS, made_up


def spoiled(log: Path, opcode: int, number: int, at: int = 60) -> None:
    """Flips a bit within the record of a kind that comes at that place among its kind."""
    data = bytearray(log.read_bytes())
    found = [frame for frame in frames(bytes(data)) if frame.opcode == opcode]
    data[found[number].offset + at] ^= 1
    log.write_bytes(data)


@pytest.fixture
def saved(log: Path) -> Path:
    return log.with_name("saved.mcap")


def test_a_hole_is_marked_and_what_follows_it_is_saved(log: Path, saved: Path):
    true = read_log(log).trial.behaviour
    spoiled(log, Opcode.CHUNK, 2)  # steps 1 to 50
    told = salvage(log, saved)
    read = read_log(saved)

    assert (told.steps, told.span, told.planned) == (STEPS - 50, STEPS, STEPS)
    assert read.status == "interrupted"
    assert told.missing.pop("/tf") == 10
    assert set(told.missing.values()) == {50}
    assert salvageable_steps(log) == STEPS - 50
    for signal in SIGNALS:
        assert np.isnan(read.trial.behaviour[signal][1:51]).all()
        for kept in (slice(1), slice(51, None)):
            assert read.trial.behaviour[signal][kept].tobytes() == true[signal][kept].tobytes()


@pytest.mark.parametrize("share", [0.3, 0.5, 0.8, 0.999])
def test_of_a_truncated_file_every_complete_step_is_saved(log: Path, saved: Path, share: float):
    true = read_log(log).trial.behaviour
    data = log.read_bytes()
    log.write_bytes(data[: int(share * len(data))])
    chunks = [frame for frame in complete(log.read_bytes()) if frame == Opcode.CHUNK]
    told = salvage(log, saved)

    expected = [0, 1, 51, 101, 120][len(chunks) - 1]
    assert told.steps == salvageable_steps(log) == expected
    assert told.missing == {}
    read = read_log(saved).trial
    assert read.plan.steps == STEPS
    for signal in SIGNALS:
        assert read.behaviour[signal].tobytes() == true[signal][:expected].tobytes()


def complete(data: bytes) -> list[int]:
    """The kinds of the records that a cut file still has whole."""
    found = []
    with contextlib.suppress(EndOfFile):
        found.extend(frame.opcode for frame in frames(data))
    return found


def test_bytes_that_make_no_sense_are_stepped_over(log: Path, saved: Path):
    true = read_log(log).trial.behaviour
    data = log.read_bytes()
    chunks = [frame for frame in frames(data) if frame.opcode == Opcode.CHUNK]
    middle = chunks[3].offset
    log.write_bytes(data[:middle] + b"\x06\xff\xff" * 333 + data[middle:])
    told = salvage(log, saved)

    assert (told.steps, told.missing) == (STEPS, {})
    assert read_log(saved).trial.behaviour["sensors"].tobytes() == true["sensors"].tobytes()


def test_a_chunk_that_stands_twice_counts_once(log: Path, saved: Path):
    data = log.read_bytes()
    chunk = [frame for frame in frames(data) if frame.opcode == Opcode.CHUNK][2]
    log.write_bytes(data[: chunk.end] + data[chunk.offset :])

    assert salvage(log, saved).steps == STEPS
    assert len(read_contents(saved).topics["/odom"].payloads) == STEPS


def test_without_its_controller_a_trial_is_played_back(log: Path, saved: Path):
    true = read_log(log).trial
    assert isinstance(true.plan.controller, Controller)
    spoiled(log, Opcode.ATTACHMENT, 1)
    told = salvage(log, saved)
    driver = read_log(saved).trial.plan.controller

    assert told.lost == ("controller.npz",)
    assert driver == Playback(true.behaviour.names.motors, true.behaviour["commands"])


def test_without_its_controller_a_command_that_is_lost_stands_until_the_next(
    log: Path, saved: Path
):
    commands = read_log(log).trial.behaviour["commands"]
    spoiled(log, Opcode.ATTACHMENT, 1)
    spoiled(log, Opcode.CHUNK, 2)  # steps 1 to 50
    assert salvageable_steps(log) == STEPS - 50
    salvage(log, saved)
    trial = read_log(saved).trial
    driver = trial.plan.controller

    assert isinstance(driver, Playback)
    assert np.isnan(trial.behaviour["commands"][1:51]).all()
    assert np.array_equal(driver.commands[1:51], np.tile(commands[0], (50, 1)))
    assert np.array_equal(driver.commands[51:], commands[51:])


def test_a_record_that_claims_more_bytes_swallows_nothing(log: Path, saved: Path):
    data = bytearray(log.read_bytes())
    every = list(frames(bytes(data)))
    chunk = [frame for frame in every if frame.opcode == Opcode.CHUNK][3]
    index = [f for f in every if f.opcode == Opcode.MESSAGE_INDEX and f.end <= chunk.offset][-1]
    length = chunk.end - index.offset - FRAME
    data[index.offset + 1 : index.offset + FRAME] = length.to_bytes(8, "little")
    log.write_bytes(data)
    told = salvage(log, saved)

    assert (told.steps, told.missing, told.lost) == (STEPS, {}, ())


def test_what_viewers_draw_by_is_told_when_it_is_lost(log: Path, saved: Path):
    spoiled(log, Opcode.CHUNK, 0, at=300)  # the description, and what the topics are called

    assert salvage(log, saved).lost == ("/robot_description",)


def test_frames_of_a_type_that_selfmodel_does_not_write_are_left_out(log: Path, saved: Path):
    file = read_file(log.read_bytes())
    number = next(k for k, schema in file.schemas.items() if schema.name == TRANSFORMS_TYPE)
    file.schemas[number] = dataclasses.replace(file.schemas[number], name="other_msgs/msg/Frames")
    file.items = [item for item in file.items if getattr(item, "name", "") != RESULT]
    seal(file)
    log.write_bytes(written(file))
    told = salvage(log, saved)

    assert (told.steps, set(told.missing)) == (STEPS, {TRANSFORMS})
    assert TRANSFORMS not in read_contents(saved).topics


def test_without_its_settings_a_trial_has_those_of_the_paper(log: Path, saved: Path):
    spoiled(log, Opcode.ATTACHMENT, 2)

    assert salvage(log, saved).lost == ("settings.json",)
    assert read_log(saved).settings == Settings()


def test_steps_that_a_salvage_filled_in_are_not_complete_in_the_next(
    log: Path, saved: Path, tmp_path: Path
):
    spoiled(log, Opcode.CHUNK, 2)  # steps 1 to 50
    first = salvage(log, saved)
    saved.write_bytes(saved.read_bytes()[:-20])
    second = salvage(saved, tmp_path / "again.mcap")

    assert (second.steps, second.span) == (first.steps, first.span) == (STEPS - 50, STEPS)


def test_a_record_or_a_file_of_the_model_that_is_lost_is_reported(
    biped: Robot, plan: TrialPlan, tmp_path: Path, saved: Path
):
    robot = Robot("biped", biped.mjcf, biped.control_timestep, {"mesh.stl": bytes(100)})
    log = tmp_path / "with-mesh.mcap"
    write_trial(log, robot, plan, made_up(biped, STEPS), TrialHeader(Settings(), hidden="intact"))
    spoiled(log, Opcode.ATTACHMENT, 1)
    spoiled(log, Opcode.METADATA, 1, at=40)

    assert salvage(log, saved).lost == ("selfmodel.software", "mesh.stl")


def test_that_the_truth_was_removed_is_no_loss(log: Path, saved: Path):
    spoiled(log, Opcode.METADATA, 2, at=40)

    assert salvage(log, saved).lost == ()
    assert read_truth(saved) is None


@pytest.mark.parametrize(
    ("opcode", "number", "match"),
    [
        (Opcode.METADATA, 0, r"no record selfmodel\.trial"),
        (Opcode.ATTACHMENT, 0, r"no attachment model\.xml"),
    ],
)
def test_without_its_first_record_or_its_model_nothing_can_be_saved(
    log: Path, saved: Path, opcode: int, number: int, match: str
):
    spoiled(log, opcode, number)
    with pytest.raises(LogError, match=match):
        salvage(log, saved)
    assert not list(log.parent.glob("saved*"))
    assert salvageable_steps(log) in (0, STEPS)


def test_the_original_is_left_alone_and_the_truth_goes_along_unseen(log: Path, saved: Path):
    spoiled(log, Opcode.CHUNK, 2)
    before = log.read_bytes(), log.stat().st_mtime_ns
    salvage(log, saved)

    assert (log.read_bytes(), log.stat().st_mtime_ns) == before
    assert read_truth(saved) == "intact"
    contents = read_contents(saved, unread=(HIDDEN,))
    told = {
        "source": "trial.mcap",
        "source_sha256": sha256(before[0]),
        "complete_steps": str(STEPS - 50),
        "tied": "yes",
    }
    assert contents.metadata[SALVAGE] == told


def test_a_sound_log_is_not_salvaged(log: Path, saved: Path):
    with pytest.raises(InputError, match="is valid, and the trial in it is finished: there"):
        salvage(log, saved)
    spoiled(log, Opcode.CHUNK, 2)
    salvage(log, saved)
    with pytest.raises(InputError, match="the trial in it is interrupted"):
        salvage(saved, log.with_name("again.mcap"))


@pytest.mark.parametrize("name", ["saved.mcap", "saved.mcap.part"])
def test_nothing_is_overwritten(log: Path, saved: Path, name: str):
    spoiled(log, Opcode.CHUNK, 2)
    log.with_name(name).write_text("precious")
    with pytest.raises(InputError, match=f"{name} exists"):
        salvage(log, saved)
    assert log.with_name(name).read_text() == "precious"


def test_a_disk_that_fills_leaves_no_half_of_a_log(
    log: Path, saved: Path, monkeypatch: pytest.MonkeyPatch
):
    def fail(*_: object) -> None:
        raise OSError(28, os.strerror(28))

    spoiled(log, Opcode.CHUNK, 2)
    monkeypatch.setattr(Writer, "add_message", fail)
    with pytest.raises(LogWriteError, match="the disk is full"):
        salvage(log, saved)
    assert [path.name for path in log.parent.iterdir()] == ["trial.mcap"]


@pytest.mark.parametrize(
    "spoil", [lambda _: b"", lambda _: b"no log at all", lambda d: d[:200], lambda d: d[-200:]]
)
def test_where_nothing_is_left_that_is_said(
    log: Path, saved: Path, spoil: Callable[[bytes], bytes]
):
    log.write_bytes(spoil(log.read_bytes()))
    with pytest.raises(LogError, match=r"trial\.mcap: "):
        salvage(log, saved)
    assert salvageable_steps(log) == 0
    assert not saved.exists()
