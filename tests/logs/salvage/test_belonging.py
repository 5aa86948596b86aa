"""Promises of salvage: only what belongs to one trial is saved, and the rest is reported."""

import json
import os
import shutil
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from mcap.opcode import Opcode
from mcap.records import Message
from mcap.writer import CompressionType
from typer.testing import CliRunner

from selfmodel.cli.logs import app
from selfmodel.logs import CorruptError, read_log
from selfmodel.logs.mcap.checksums import verified_records
from selfmodel.logs.mcap.contents import read_contents
from selfmodel.logs.mcap.framing import frames
from selfmodel.logs.mcap.provenance import identity_of
from selfmodel.logs.records import MANIFEST, SALVAGE, TrialHeader
from selfmodel.logs.salvage import salvage
from selfmodel.logs.salvage.belonging import Discarded
from selfmodel.logs.verify import verify
from selfmodel.logs.writing.writer import write_trial
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.signals import SIGNALS
from tests.fuzz.mcap_file import of_records, written
from tests.logs import splice
from tests.logs.conftest import STEPS, made_up, plan_of
from tests.logs.salvage.test_salvage import spoiled

OLD = Path(__file__).parents[2] / "data" / "logs-0.1"


@pytest.fixture
def other(biped: Robot, tmp_path: Path) -> Path:
    """A log of another trial of the robot."""
    path = tmp_path / "other" / "trial.mcap"
    path.parent.mkdir()
    header = TrialHeader(Settings(), hidden="sensor:left_touch")
    plan = plan_of(biped, STEPS, "01-after")
    return write_trial(path, biped, plan, made_up(biped, STEPS, seed=1), header)


@pytest.fixture
def saved(log: Path) -> Path:
    return log.with_name("saved.mcap")


def identity(log: Path) -> str:
    return identity_of(read_contents(log).metadata[MANIFEST]).hex()


def chunks(log: Path) -> list[bytes]:
    data = log.read_bytes()
    return [data[f.offset : f.end] for f in frames(data) if f.opcode == Opcode.CHUNK]


def spliced(log: Path, *pieces: bytes) -> None:
    """Writes these chunks in the place of those of a log."""
    data = log.read_bytes()
    found = [frame for frame in frames(data) if frame.opcode == Opcode.CHUNK]
    log.write_bytes(data[: found[0].offset] + b"".join(pieces) + data[found[-1].end :])


def test_of_two_halves_only_the_half_of_the_first_trial_is_saved(
    log: Path, other: Path, saved: Path
):
    true, foreign = read_log(log).trial.behaviour, identity(other)
    own, others = log.read_bytes(), other.read_bytes()
    start, end = (
        [frame for frame in frames(data) if frame.opcode == Opcode.CHUNK][3].offset
        for data in (own, others)
    )
    log.write_bytes(own[:start] + others[end:])
    told = salvage(log, saved)

    assert (told.steps, told.span, told.tied) == (51, 51, True)
    assert told.discarded == (Discarded("01-after", foreign, batches=2, steps=STEPS - 51),)
    for signal in SIGNALS:
        assert read_log(saved).trial.behaviour[signal].tobytes() == true[signal][:51].tobytes()


def test_a_chunk_of_another_trial_is_a_hole(log: Path, other: Path, saved: Path):
    foreign = identity(other)
    own, others = chunks(log), chunks(other)
    spliced(log, *own[:2], others[2], *own[3:])
    told = salvage(log, saved)

    assert (told.steps, told.span) == (STEPS - 50, STEPS)
    assert told.discarded == (Discarded("01-after", foreign, batches=1, steps=50),)
    assert np.isnan(read_log(saved).trial.behaviour["sensors"][1:51]).all()


def test_chunks_of_another_trial_beside_all_of_its_own_change_nothing(
    log: Path, other: Path, saved: Path
):
    true = read_log(log).trial.behaviour
    spliced(log, *reversed(chunks(other)), *reversed(chunks(log)), *chunks(log))
    told = salvage(log, saved)

    assert (told.steps, told.missing) == (STEPS, {})
    assert [found.batches for found in told.discarded] == [5]
    for signal in SIGNALS:
        assert read_log(saved).trial.behaviour[signal].tobytes() == true[signal].tobytes()


def test_without_a_step_of_its_own_nothing_is_saved(log: Path, other: Path, saved: Path):
    spliced(log, *chunks(other))
    with pytest.raises(CorruptError, match=r"not one step .* and 120 other steps in the file are"):
        salvage(log, saved)
    assert not saved.exists()


def test_a_lost_manifest_is_made_again(log: Path, saved: Path):
    spoiled(log, Opcode.METADATA, 3)
    told = salvage(log, saved)

    assert (told.steps, told.tied, told.discarded) == (STEPS, True, ())


def test_batches_of_two_runs_of_a_trial_that_claim_to_be_equal_are_not_chosen_from(
    log: Path, biped: Robot, saved: Path, tmp_path: Path
):
    again = tmp_path / "again.mcap"
    header = TrialHeader(Settings(), hidden="intact")
    samples = made_up(biped, STEPS, seed=1)
    write_trial(again, biped, plan_of(biped, STEPS), samples, header)
    own, others = chunks(log), chunks(again)
    data = log.read_bytes()
    for pieces in ([*own, others[2]], [*own[:2], *others[2:]]):
        log.write_bytes(data)
        spliced(log, *pieces)
        with pytest.raises(CorruptError, match=r"two different batches 2|are of different runs"):
            salvage(log, saved)


def test_an_altered_batch_is_left_out(log: Path, saved: Path):
    own = identity(log)
    records = list(verified_records(log.read_bytes()))
    for record in records:
        if isinstance(record, Message) and record.log_time == 70 * 10**7:
            record.data = record.data[:-1] + b"\1"
    log.write_bytes(written(of_records(records), CompressionType.ZSTD, 2**20))
    told = salvage(log, saved)

    assert told.steps == STEPS - 50
    assert told.discarded == (Discarded("00-before", own, batches=1, steps=50),)


def test_a_log_of_an_earlier_version_is_salvaged_and_said_to_be_untied(tmp_path: Path):
    shutil.copytree(OLD / "damaged", tmp_path / "old")
    damaged, out = tmp_path / "old" / "trial.mcap", tmp_path / "new.mcap"
    done = CliRunner().invoke(app, ["salvage", str(damaged), "-o", str(out)])

    assert done.exit_code == 0
    assert "not tied to its trial: an earlier version of selfmodel wrote it" in done.output
    assert read_contents(out).metadata[SALVAGE]["tied"] == "no"
    assert verify(out).digest
    out.write_bytes(out.read_bytes()[:-1])
    assert salvage(out, tmp_path / "newer.mcap").tied is False


def test_different_messages_of_one_time_in_a_log_of_an_earlier_version_are_not_chosen_from(
    tmp_path: Path,
):
    log = tmp_path / "log.mcap"
    shutil.copy(OLD / "trials" / "kinds.mcap", log)
    spliced(log, *chunks(log), chunks(OLD / "trials" / "silent-neuron.mcap")[-1])
    with pytest.raises(CorruptError, match="two different messages of time"):
        salvage(log, tmp_path / "new.mcap")


def test_chunks_of_a_newer_log_are_left_out_of_one_of_an_earlier_version(log: Path, tmp_path: Path):
    mixed = tmp_path / "mixed.mcap"
    shutil.copy(OLD / "trials" / "kinds.mcap", mixed)
    spliced(mixed, *chunks(mixed), *chunks(log))
    told = salvage(mixed, tmp_path / "new.mcap")

    assert (told.steps, told.tied) == (60, False)
    assert [(found.trial, found.batches) for found in told.discarded] == [("00-before", 5)]


def test_the_command_reports_what_it_leaves_out(log: Path, other: Path, saved: Path):
    foreign = identity(other)
    own, others = chunks(log), chunks(other)
    spliced(log, *own[:2], others[2], *own[3:])
    arguments = ["salvage", str(log), "-o"]
    said = CliRunner().invoke(app, [*arguments, str(saved)]).output
    told = CliRunner().invoke(app, [*arguments, str(log.with_name("b.mcap")), "--json"]).output

    line = f"left out: 50 steps in 1 batch sealed for the trial 01-after ({foreign[:12]})"
    assert line in said
    assert json.loads(told)["discarded"] == [
        {"trial": "01-after", "identity": foreign, "batches": 1, "steps": 50}
    ]


@pytest.mark.parametrize("cases", [42, pytest.param(1000, marks=pytest.mark.fuzz)])
def test_a_spliced_file_is_never_salvaged_as_a_mixture(cases: int, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(os, "fsync", lambda _: None)
    outcomes = sum(splice.run(cases, seed=1).values(), Counter())

    assert outcomes.total() == cases
    assert outcomes["salvaged"] > cases / 2
