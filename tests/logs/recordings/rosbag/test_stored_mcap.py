from pathlib import Path

import pytest
from mcap.opcode import Opcode
from mcap.records import Message
from mcap.stream_reader import StreamReader
from mcap.writer import Writer

from selfmodel.logs.errors import CorruptError, TruncatedError
from selfmodel.logs.mcap.framing import frames
from selfmodel.logs.recordings.rosbag.stored import Stored
from selfmodel.logs.recordings.rosbag.stored_mcap import read_mcap
from tests.logs.recordings.rosbag.bags import T0

MESSAGES = 20


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """A recording without chunks, and so without checksums, as some recorders write it."""
    path = tmp_path / "bag.mcap"
    with path.open("wb") as file:
        writer = Writer(file, use_chunking=False)
        writer.start("ros2")
        schema = writer.register_schema("std_msgs/msg/Bool", "ros2msg", b"bool data")
        channel = writer.register_channel("/x", "cdr", schema)
        for time in range(MESSAGES):
            writer.add_message(channel, T0 + time, b"\x00\x01\x00\x00\x01", T0 + time)
        writer.finish()
    return path


def messages(path: Path) -> int:
    return sum(isinstance(item, Stored) for item in read_mcap(path, path))


def damage(path: Path, offset: int, data: bytes) -> None:
    """Overwrites bytes of the sixth message, from an offset in its record on."""
    content = bytearray(path.read_bytes())
    record = [frame for frame in frames(bytes(content)) if frame.opcode == Opcode.MESSAGE][5]
    content[record.offset + offset : record.offset + offset + len(data)] = data
    path.write_bytes(content)


def test_an_undamaged_recording_is_read(recording: Path):
    assert messages(recording) == MESSAGES


def test_a_message_whose_record_has_a_damaged_type_is_missed(recording: Path):
    damage(recording, 0, b"\x45")

    with recording.open("rb") as file:  # the library skips the record
        records = StreamReader(file, validate_crcs=True).records
        assert sum(isinstance(record, Message) for record in records) == MESSAGES - 1
    with pytest.raises(CorruptError, match="its statistics have 20 messages, its records 19"):
        messages(recording)


def test_a_message_of_a_damaged_channel_is_refused(recording: Path):
    damage(recording, 9, b"\x07")

    with pytest.raises(CorruptError, match="a message is of channel 7, which is unknown"):
        messages(recording)


def test_a_damaged_length_is_damage_and_no_lack_of_memory(recording: Path):
    damage(recording, 1, (2**62).to_bytes(8, "little"))

    with pytest.raises((TruncatedError, CorruptError)):
        messages(recording)
