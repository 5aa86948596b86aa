"""Bags of every form are read, and whatever is damaged is said to be."""

import hashlib
import os
import shutil
import sqlite3
import struct
from contextlib import closing, suppress
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer
from rosbags.typesys import Stores, get_typestore

from selfmodel.errors import InputError
from selfmodel.logs.errors import (
    CorruptError,
    IncompleteError,
    LogError,
    NotMcapError,
    TruncatedError,
    UnsupportedError,
)
from selfmodel.logs.recordings.mapping.checks import TYPES
from selfmodel.logs.recordings.mapping.suggest import suggest
from selfmodel.logs.recordings.rosbag.bag import read_bag
from selfmodel.logs.recordings.rosbag.messages import KINDS
from selfmodel.robot.robot import Robot
from tests.logs.recordings.conftest import decoded, imported, recorded
from tests.logs.recordings.rosbag.bags import FORMS, ROS, T0, array, spoilt, storage, write_bag

SAMPLES = Path(__file__).parents[5] / "shared" / "samples"
GENUINE = sorted((SAMPLES / "rosbag2").glob("*.mcap"))


def read_all(path: Path) -> dict[str, int]:
    """Reads every topic that can play a role, and counts the messages of all."""
    known = {kind for kinds in TYPES.values() for kind in kinds}
    topics = read_bag(path, ()).topics
    bag = read_bag(path, [name for name, topic in topics.items() if topic.type in known])
    return {name: topic.count for name, topic in bag.topics.items()}


@pytest.fixture(scope="module")
def expected(biped: Robot, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """What the made-up recording is, in its plainest form."""
    folder = write_bag(tmp_path_factory.mktemp("plain") / "bag", recorded())
    return signals(folder, biped)


def signals(path: Path, robot: Robot) -> dict[str, bytes]:
    behaviour = imported(path, robot).behaviour
    return {name: values.tobytes() for name, values in behaviour.signals.items()}


@pytest.mark.parametrize("form", FORMS)
def test_every_form_says_the_same(form: str, biped: Robot, expected: dict, tmp_path: Path):
    folder = write_bag(tmp_path / "bag", recorded(), form)
    assert signals(folder, biped) == expected
    assert signals(storage(folder), biped) == expected  # the bare file
    (folder / "metadata.yaml").unlink()
    assert signals(folder, biped) == expected


def test_what_a_recorder_left_beside_its_database_is_not_passed_over(tmp_path: Path):
    database = storage(write_bag(tmp_path / "bag", recorded(), "sqlite"))
    with closing(sqlite3.connect(database)) as recorder:
        recorder.execute("PRAGMA journal_mode=WAL")
        recorder.execute("PRAGMA wal_autocheckpoint=0")
        recorder.execute("DELETE FROM messages WHERE id > 5")
        recorder.commit()
        with pytest.raises(IncompleteError, match=r"did not close it: .*-wal .*wal_checkpoint"):
            read_bag(database, ())


def test_a_pipe_among_the_files_of_a_bag_is_not_waited_for(bag: Path):
    name = storage(bag).name
    (bag / "metadata.yaml").unlink()
    os.mkfifo(bag / "more.mcap")
    assert [source.name for source in read_bag(bag, ()).sources] == [name]


@pytest.mark.parametrize("form", ["mcap", "sqlite", "mcap-file", "mcap-message"])
@pytest.mark.parametrize("listed", [True, False])
def test_split_files_are_one_bag(
    form: str, *, listed: bool, biped: Robot, expected: dict, tmp_path: Path
):
    items = sorted(recorded(), key=lambda item: item[1])
    whole = tmp_path / "whole"
    whole.mkdir()
    names = []
    for k in range(11):
        part = [item for n, item in enumerate(items) if n * 11 // len(items) == k]
        source = storage(write_bag(tmp_path / f"part_{k}", part, form))
        names.append(source.name)
        shutil.move(source, whole / source.name)
    if listed:
        entries = "".join(f"  - old_folder/{name}\n" for name in names)
        (whole / "metadata.yaml").write_text(
            f"rosbag2_bagfile_information:\n  relative_file_paths:\n{entries}"
        )
    assert signals(whole, biped) == expected
    assert [source.name for source in read_bag(whole, ()).sources] == names


@pytest.mark.parametrize("chunked", [True, False])
@pytest.mark.parametrize("compression", [CompressionType.LZ4, CompressionType.NONE])
def test_other_writers_of_mcap_are_read(
    *, chunked: bool, compression: CompressionType, biped: Robot, expected: dict, tmp_path: Path
):
    path = tmp_path / "bag.mcap"
    with path.open("wb") as file:
        writer = Writer(file, compression=compression, use_chunking=chunked)
        writer.start("ros2")
        channels = {}
        for topic, time, message in sorted(recorded(), key=lambda item: item[1]):
            kind = message.__msgtype__
            if topic not in channels:
                # Old recordings leave out the middle of the name.
                schema = writer.register_schema(kind.replace("/msg/", "/"), "ros2msg", b"")
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channels[topic], time, bytes(ROS.serialize_cdr(message, kind)), time)
        writer.finish()
    assert signals(path, biped) == expected


@pytest.mark.parametrize("path", GENUINE, ids=lambda path: path.stem)
def test_genuine_recordings_are_read_or_refused(path: Path, biped: Robot):
    assert read_all(path)
    assert "CHANGE: the bag has none" in suggest(path, biped, "b.xml", with_timestep=True)
    with pytest.raises(InputError, match=r"MAP\.toml:5: unknown topic of the bag"):
        imported(path, biped)


def test_a_foreign_encoding_is_refused_only_where_it_is_wanted(tmp_path: Path):
    path = tmp_path / "foreign.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        schema = writer.register_schema("std_msgs/msg/Bool", "ros2msg", b"bool data")
        channel = writer.register_channel("/foreign", "wrong_format", schema)
        for time in range(3):
            writer.add_message(channel, T0 + time, b"?", T0 + time)
        writer.finish()
    assert read_bag(path, ()).topics["/foreign"].count == 3
    with pytest.raises(UnsupportedError, match="in cdr or ros1 on /foreign, got 'wrong_format'"):
        read_bag(path, ["/foreign"])


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("damage", ["flip", "cut", "garbage"])
def test_no_damage_crashes(form: str, damage: str, tmp_path: Path):
    path = storage(write_bag(tmp_path / "bag", recorded(0.1), form))
    data = path.read_bytes()
    rng = np.random.default_rng(list(FORMS).index(form))
    for _ in range(25):
        path.write_bytes(spoilt(data, damage, rng))
        with suppress(LogError, InputError):
            decoded(path)


def test_damaged_lists_of_files_do_not_crash(bag: Path):
    listing = bag / "metadata.yaml"
    data = listing.read_bytes()
    rng = np.random.default_rng(0)
    for _ in range(50):
        listing.write_bytes(spoilt(data, "flip", rng))
        with suppress(LogError, InputError):
            assert decoded(bag).header["topics"]


def test_damage_is_called_by_its_name(bag: Path, tmp_path: Path):
    path = storage(bag)
    data = path.read_bytes()
    path.write_bytes(data[:-20])
    with pytest.raises(TruncatedError, match=r"ends too early; .* messages before that"):
        read_all(path)
    path.write_bytes(data + b"x")
    with pytest.raises(CorruptError, match="bytes follow its end"):
        read_all(path)
    path.write_bytes(b"hello")
    with pytest.raises(NotMcapError, match=r"no recording of ROS; give a bag's folder"):
        read_all(path)
    path.unlink()
    with pytest.raises(CorruptError, match=r"lists missing files: bag\.mcap"):
        read_all(bag)
    (bag / "metadata.yaml").unlink()
    with pytest.raises(InputError, match="a folder without one"):
        read_all(bag)
    with pytest.raises(InputError, match="No such file"):
        read_all(tmp_path / "nothing")


def test_a_message_of_another_type_than_it_says_is_refused(tmp_path: Path):
    path = storage(write_bag(tmp_path / "bag", [("/x", T0, array([1.5]))]))
    count = struct.pack("<I4xd", 1, 1.5)
    assert path.read_bytes().count(count) == 1
    path.write_bytes(path.read_bytes().replace(count, struct.pack("<I4xd", 3, 1.5)))
    with pytest.raises(CorruptError, match="a message on /x is damaged"):
        read_all(path)


def test_the_digest_of_each_file_is_that_of_the_file_as_found(bag: Path):
    (source,) = read_bag(bag, ()).sources
    assert source.sha256 == hashlib.sha256(storage(bag).read_bytes()).hexdigest()


@pytest.mark.parametrize("store", [store for store in Stores if store.name.startswith("ROS2")])
def test_the_types_that_are_read_are_alike_in_every_ros_2(store: Stores):
    other = get_typestore(store)
    for kind in KINDS:
        assert other.generate_msgdef(kind, ros_version=2) == ROS.generate_msgdef(
            kind, ros_version=2
        )
