"""Sound files whose content is no trial, or of an impossible one, are refused by name."""

from collections.abc import Callable
from pathlib import Path

import pytest
from mcap.records import Attachment, McapRecord, Message, Metadata

from selfmodel.logs import (
    CorruptError,
    IncompleteError,
    LogError,
    SchemaMismatchError,
    UnsupportedError,
    read_log,
)
from selfmodel.logs.inspection import verify
from selfmodel.logs.records import CONTROLLER_FILE, MODEL_FILE, RESULT, TRIAL
from tests.logs.edits import Change, attach, holds, rewritten, says, without

HALF_A_SECOND, ODOMETRY = 50 * 10**7, "nav_msgs/msg/Odometry"


def replaced(name: str, old: bytes, new: bytes) -> Change:
    return holds(name, lambda data: data.replace(old, new))


def at_half_a_second(change: Callable[[Message], Message | None]) -> Change:
    def changed(record: McapRecord) -> McapRecord | None:
        found = isinstance(record, Message) and record.log_time == HALF_A_SECOND
        return change(record) if found else record

    return changed


def later(record: Message) -> Message:
    record.log_time += 1
    return record


def stamped(record: Message) -> Message:
    record.data = record.data[:4] + b"\1" + record.data[5:]  # a second later
    return record


def forged(record: McapRecord) -> McapRecord:
    if isinstance(record, Metadata) and record.name == TRIAL:
        return Metadata(name=TRIAL, metadata={**record.metadata, "seed": "8"})
    return record


def renamed(record: McapRecord) -> McapRecord:
    if isinstance(record, Message):
        record.data = record.data.replace(b"left_touch", b"left_torch")
    return record


def called(field: str, old: str, new: str) -> Change:
    def change(record: McapRecord) -> McapRecord:
        if getattr(record, field, "") == old:
            setattr(record, field, new)
        return record

    return change


@pytest.mark.parametrize(
    ("change", "error", "match"),
    [
        (without(Metadata, TRIAL), SchemaMismatchError, r"selfmodel\.trial"),
        (without(Metadata, RESULT), IncompleteError, "did not finish; 625 messages"),
        (says(TRIAL, format="3"), UnsupportedError, "'3'"),
        (says(TRIAL, format="2"), SchemaMismatchError, "/timing"),
        (says(TRIAL, stage="later"), SchemaMismatchError, "stage"),
        (says(TRIAL, steps="many"), SchemaMismatchError, "steps"),
        (says(TRIAL, name="x" * 10**7), SchemaMismatchError, "name"),
        (says(TRIAL, control_timestep="0.02"), SchemaMismatchError, "times on /joint_states"),
        *[
            (says(TRIAL, control_timestep=step), SchemaMismatchError, "control_timestep")
            for step in ("nan", "1e-300", "inf")
        ],
        *[
            (says(TRIAL, seed=seed), SchemaMismatchError, r"selfmodel\.trial")
            for seed in ("-1", str(2**63), "1.5")
        ],
        (says(RESULT, status="lost"), UnsupportedError, "'lost'"),
        (says(RESULT, status="interrupted", steps="119"), CorruptError, "120 messages"),
        (says(RESULT, steps="119"), IncompleteError, "after 119 of 120 steps"),
        (says(RESULT, displacement="1.5"), CorruptError, r"1\.5 m"),
        (without(Attachment, MODEL_FILE), SchemaMismatchError, r"model\.xml"),
        (replaced(MODEL_FILE, b"0.6", b"0.7"), CorruptError, r"model\.xml"),
        (replaced(CONTROLLER_FILE, b"<f8", b"<f4"), CorruptError, r"controller\.npz"),
        (replaced("settings.json", b"steps", b"stops"), SchemaMismatchError, "'stops'"),
        (at_half_a_second(later), SchemaMismatchError, "times on /joint_states"),
        (at_half_a_second(stamped), SchemaMismatchError, "times on /joint_states"),
        (at_half_a_second(lambda _: None), CorruptError, "119 messages on /joint_states"),
        (forged, CorruptError, r"digest of the record selfmodel\.trial"),
        (renamed, SchemaMismatchError, "controller"),
        (called("topic", "/odom", "/odometry"), SchemaMismatchError, "/odom"),
        (called("topic", "/tf", "/odom"), CorruptError, "'/odom' twice"),
        (called("name", ODOMETRY, "a/msg/A"), SchemaMismatchError, f"{ODOMETRY} in cdr on /odom"),
        (replaced(ODOMETRY, b"twist", b"turn"), SchemaMismatchError, "definition of nav_msgs"),
    ],
)
def test_a_log_that_contradicts_itself_is_refused_by_name(
    log: Path, change: Change, error: type[LogError], match: str
):
    rewritten(log, change)
    with pytest.raises(error, match=match) as refusal:
        read_log(log)
    assert len(str(refusal.value)) < 4000


def test_a_log_that_is_only_written_again_is_read(log: Path):
    rewritten(log, lambda record: record)

    assert read_log(log).trial.plan.name == "00-before"


@pytest.mark.parametrize(
    "data",
    [
        *(b"[" * 10**5, b'{"a":' * 10**5, b"null", b"\xff\xfe\xff", b'{"\\ud800": 1}'),
        *(b'{"steps": -5}', b'{"steps": true}', b'{"steps": ' + b"9" * 5000 + b"}"),
        *(b'{"mutation": NaN}', b'{"mutation": Infinity}', b'{"mutation": 1e400}'),
    ],
)
def test_settings_that_are_none_are_refused(log: Path, data: bytes):
    rewritten(log, holds("settings.json", lambda _: data))
    with pytest.raises(LogError, match="an attachment"):
        read_log(log)


def test_verify_looks_into_the_model(log: Path):
    attach(log, MODEL_FILE, "model_sha256", b'<mujoco><include file="/etc/passwd"/></mujoco>')
    read_log(log)  # nothing loads it
    with pytest.raises(LogError, match=r"<include> \('/etc/passwd'\)"):
        verify(log)
