"""Damaged bytes: a log is read as it was written, or refused; a salvage has its first steps."""

import io
import zlib
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings, strategies as st
from mcap.writer import CompressionType, Writer

from selfmodel.errors import InputError
from selfmodel.logs import (
    CorruptError,
    LogError,
    NotMcapError,
    TrialLog,
    TruncatedError,
    UnsupportedError,
    read_log,
)
from selfmodel.logs.salvage import salvage
from tests.helpers.damage import damaged


def content(log: TrialLog) -> tuple[object, ...]:
    """Returns all that a log says, but its path and its status."""
    signals = log.trial.trajectory.signals
    return (
        log.mjcf,
        log.root,
        log.control_timestep,
        log.settings,
        dict(log.assets),
        dict(log.software),
        log.trial.robot,
        log.trial.plan,
        {name: values.tobytes() for name, values in signals.items()},
    )


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(data=st.data())
def test_a_damaged_log_is_refused_or_is_what_was_written(log: Path, data: st.DataObject):
    whole = log.read_bytes()
    spoilt = log.with_name("spoilt.mcap")
    spoilt.write_bytes(data.draw(damaged(whole)))

    try:
        found = read_log(spoilt)
    except LogError as error:
        sentence = str(error)
    else:
        sentence = f"{spoilt}: "
        assert content(found) == content(read_log(log))
    assert sentence.startswith(f"{spoilt}: ")
    assert "\n" not in sentence


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(data=st.data())
def test_the_salvage_of_a_damaged_log_has_its_first_steps_and_nothing_else(
    log: Path, data: st.DataObject
):
    whole, expected = log.read_bytes(), read_log(log)
    spoilt, saved = log.with_name("spoilt.mcap"), log.with_name("saved.mcap")
    saved.unlink(missing_ok=True)
    spoilt.write_bytes(data.draw(damaged(whole)))

    try:
        result = salvage(spoilt, saved)
    except LogError:
        assert not saved.exists()
    except InputError:
        assert content(read_log(spoilt)) == content(expected)
    else:
        found = read_log(saved)
        assert found.trial.trajectory.steps == result.steps
        for name, values in found.trial.trajectory.signals.items():
            assert values.tobytes() == expected.trial.trajectory[name][: result.steps].tobytes()
        assert content(found)[:-1] == content(expected)[:-1]


@pytest.mark.parametrize(
    ("spoil", "error", "match"),
    [
        (lambda _: b"", NotMcapError, "empty or too short"),
        (lambda d: d[:5], NotMcapError, "empty or too short"),
        (lambda _: b"no log at all", NotMcapError, "not an MCAP file"),
        (lambda d: d[:9000], TruncatedError, "ends too early; .* messages .* complete"),
        (lambda d: d[:-1], TruncatedError, "625 messages on 7 topics"),
        (lambda d: d + b"x", CorruptError, "last bytes are damaged"),
        (lambda d: d[:-8] + bytes(8), CorruptError, "last bytes are damaged"),
        (lambda d: d[:9000] + bytes(99) + d[9099:], CorruptError, "logs salvage"),
    ],
)
def test_damage_is_called_by_its_name(
    log: Path, spoil: Callable[[bytes], bytes], error: type[LogError], match: str
):
    log.write_bytes(spoil(log.read_bytes()))
    with pytest.raises(error, match=match):
        read_log(log)


def test_a_file_that_is_not_there_is_said_so(tmp_path: Path):
    with pytest.raises(InputError, match=r"nothing\.mcap: expected a log file"):
        read_log(tmp_path / "nothing.mcap")
    with pytest.raises(InputError, match=r"got a folder: .*NAME\.mcap"):
        read_log(tmp_path)
    (tmp_path / "metadata.yaml").touch()
    with pytest.raises(InputError, match=r"folder of a bag of ROS 2: .*`selfmodel logs import"):
        read_log(tmp_path)


@pytest.mark.parametrize("compression", CompressionType)
@pytest.mark.parametrize("chunks", [True, False])
def test_a_file_without_checksums_is_refused(
    log: Path, compression: CompressionType, *, chunks: bool
):
    output = io.BytesIO()
    writer = Writer(output, compression=compression, use_chunking=chunks, enable_crcs=False)
    writer.start("ros2")
    writer.add_message(writer.register_channel("/x", "cdr", 0), 0, b"", 0)
    writer.finish()
    log.write_bytes(output.getvalue())
    with pytest.raises(UnsupportedError, match=r"no checksum.* logs import"):
        read_log(log)


STATISTICS = 1 + 8  # opcode and length of the record
COUNTS = {"Message": 0, "Attachment": 8 + 2 + 4, "Metadata": 8 + 2 + 8, "Chunk": 8 + 2 + 12}


@pytest.mark.parametrize("kind", COUNTS)
def test_counts_that_do_not_agree_are_refused(log: Path, kind: str):
    data = bytearray(log.read_bytes())
    start = int.from_bytes(data[-28:-20], "little")  # of the summary
    opcode = b"\x0b" + (8 + 2 + 4 * 4 + 8 + 8 + 4 + 7 * 10).to_bytes(8, "little")
    data[data.rindex(opcode) + STATISTICS + COUNTS[kind]] -= 1
    data[-12:-8] = zlib.crc32(data[start:-12]).to_bytes(4, "little")
    log.write_bytes(data)
    with pytest.raises(CorruptError, match=f"statistics have .* {kind}, its records"):
        read_log(log)
