"""ROS 1 bags are read like ROS 2 bags, and whatever is damaged is reported."""

import re
import struct
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import Writer

from selfmodel.errors import InputError
from selfmodel.logs.errors import CorruptError, IncompleteError, LogError
from selfmodel.logs.recordings.mapping.suggest import suggest
from selfmodel.logs.recordings.rosbag.bag import read_bag
from selfmodel.robot.robot import Robot
from tests.logs.recordings.conftest import decoded, imported, recorded
from tests.logs.recordings.rosbag.bags import (
    ROS1_FORMS,
    ros1_payload,
    spoilt,
    write_bag,
    write_ros1,
)


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    return write_ros1(tmp_path / "walk.bag", recorded(0.2))


@pytest.mark.parametrize("form", ROS1_FORMS)
def test_a_ros_1_bag_is_imported_like_the_same_rosbag2(form: str, biped: Robot, tmp_path: Path):
    ros1 = imported(write_ros1(tmp_path / "walk.bag", recorded(), form), biped)
    ros2 = imported(write_bag(tmp_path / "bag", recorded()), biped)

    for signal, values in ros2.behaviour.signals.items():
        assert ros1.behaviour[signal].tobytes() == values.tobytes(), signal
    assert (ros1.qualities, ros1.notes, ros1.origin) == (ros2.qualities, ros2.notes, ros2.origin)


def test_the_suggestion_is_that_of_the_same_rosbag2(biped: Robot, bag: Path, tmp_path: Path):
    ros1 = write_ros1(tmp_path / "walk.bag", recorded())

    texts = {suggest(path, biped, "biped.xml", with_timestep=True) for path in (ros1, bag)}

    assert len(texts) == 1


def test_a_recording_that_was_not_closed_is_refused_with_the_remedy(recording: Path):
    data = bytearray(recording.read_bytes())
    at = data.index(b"index_pos=") + len(b"index_pos=")
    data[at : at + 8] = bytes(8)
    active = recording.with_suffix(".bag.active")
    active.write_bytes(data)

    with pytest.raises(IncompleteError, match=r"no index; add one with `rosbag reindex walk\.bag"):
        read_bag(active, ())


def test_a_cut_recording_is_refused_with_the_remedy(recording: Path):
    data = recording.read_bytes()
    for end in (len(data) - 1, len(data) // 2, 4100, 20):
        recording.write_bytes(data[:end])
        with pytest.raises(CorruptError, match=r"ends too early: .*`rosbag reindex walk\.bag`"):
            read_bag(recording, ())


def test_a_damaged_length_is_damage_and_no_lack_of_memory(recording: Path):
    data = recording.read_bytes()
    header = data.index(b"op=\x05") - 8  # of the first chunk
    recording.write_bytes(data[:header] + struct.pack("<I", 2**32 - 1) + data[header + 4 :])

    with pytest.raises(CorruptError):
        read_bag(recording, ())


def test_messages_that_the_index_lacks_are_missed(recording: Path):
    """The library reads what the index has; the chunks have counts of their own."""
    data = recording.read_bytes()
    at = data.rindex(b"op=\x04")  # the index of one topic in the last chunk
    count = data.index(b"count=", at) + len(b"count=")
    (messages,) = struct.unpack_from("<I", data, count)
    begin = count + 4
    fewer = struct.pack("<II", messages - 1, 12 * (messages - 1))
    end = begin + 4 + 12 * (messages - 1)
    # The records after the index stay where they are: the last entry becomes padding of the file.
    assert data[begin : begin + 4] == struct.pack("<I", 12 * messages)
    recording.write_bytes(
        data[:count] + fewer + data[begin + 4 : end] + bytes(12) + data[end + 12 :]
    )

    with pytest.raises(CorruptError, match=r"its chunks have .* messages, its index"):
        read_bag(recording, ())


def test_a_chunk_that_the_header_leaves_out_is_missed(recording: Path):
    data = bytearray(recording.read_bytes())
    at = data.index(b"chunk_count=") + len(b"chunk_count=")
    (count,) = struct.unpack_from("<I", data, at)
    struct.pack_into("<I", data, at, count - 1)
    recording.write_bytes(data)

    with pytest.raises(CorruptError, match=f"its header has {count - 1} chunks, its index {count}"):
        read_bag(recording, ())


def test_a_chunk_that_is_listed_twice_is_damage(recording: Path):
    data = bytearray(recording.read_bytes())
    places = [m.start() for m in re.finditer(rb"chunk_pos=", data)]
    first = data[places[0] : places[0] + 18]
    data[places[1] : places[1] + 18] = first
    recording.write_bytes(data)

    with pytest.raises(CorruptError, match="its index lists a chunk twice"):
        read_bag(recording, ())


def test_messages_of_a_damaged_connection_are_missed(recording: Path):
    """The library leaves out the messages of a connection that the index does not list."""
    data = bytearray(recording.read_bytes())
    conn = data.rindex(b"conn=", 0, data.index(b"op=\x06")) + len(b"conn=")  # the last connection
    data[conn : conn + 4] = struct.pack("<I", 77)
    recording.write_bytes(data)

    with pytest.raises(CorruptError, match=r"its chunks have .* messages, its index"):
        read_bag(recording, ())


@pytest.mark.parametrize("form", ROS1_FORMS)
@pytest.mark.parametrize("damage", ["flip", "cut", "garbage"])
def test_no_damage_of_a_ros_1_bag_crashes(form: str, damage: str, tmp_path: Path):
    path = write_ros1(tmp_path / "walk.bag", recorded(0.1), form)
    data = path.read_bytes()
    rng = np.random.default_rng(list(ROS1_FORMS).index(form))
    for _ in range(25):
        path.write_bytes(spoilt(data, damage, rng))
        with suppress(LogError, InputError):
            decoded(path)


def test_messages_of_ros_1_in_mcap_are_imported_too(biped: Robot, bag: Path, tmp_path: Path):
    path = tmp_path / "converted.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros1")
        channels: dict[str, int] = {}
        for topic, time, message in sorted(recorded(), key=lambda item: item[1]):
            kind = message.__msgtype__
            if topic not in channels:
                schema = writer.register_schema(kind.replace("/msg/", "/"), "ros1msg", b"")
                channels[topic] = writer.register_channel(topic, "ros1", schema)
            writer.add_message(channels[topic], time, bytes(ros1_payload(message)), time)
        writer.finish()
    found, expected = imported(path, biped).behaviour, imported(bag, biped).behaviour

    for signal, values in expected.signals.items():
        assert found[signal].tobytes() == values.tobytes(), signal
