"""Bags of every form are read, and whatever is damaged is refused."""

import hashlib
import os
import random
import re
import shutil
import sqlite3
import struct
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path

import numpy as np
import pytest
import zstandard
from mcap.writer import CompressionType

from selfmodel.errors import InputError
from selfmodel.logs.recordings import bags
from selfmodel.logs.recordings.bags import read_bag
from selfmodel.logs.recordings.suggest import suggest
from selfmodel.robot.robot import Robot
from tests.helpers.damage import spoilt
from tests.logs.recordings.bags import (
    FORMS,
    ROS,
    ROS1_FORMS,
    T0,
    Defined,
    array,
    storage,
    write_bag,
    write_defined,
    write_mcap,
    write_ros1,
)
from tests.logs.recordings.conftest import imported, recorded

GENUINE = Path(__file__).parents[4] / "shared" / "samples" / "rosbag2"
"""Bags of ROS 2's own recorder, which are not in the repository."""


def signals(path: Path, robot: Robot) -> dict[str, bytes]:
    trajectory = imported(path, robot).trajectory
    return {name: values.tobytes() for name, values in trajectory.signals.items()}


@pytest.fixture(scope="module")
def expected(bag: Path, biped: Robot) -> dict[str, bytes]:
    """The made-up recording in its plainest form."""
    return signals(bag, biped)


@pytest.mark.parametrize("form", FORMS)
def test_every_form_of_rosbag2_is_the_same_trial(
    form: str, biped: Robot, expected: dict, tmp_path: Path
):
    folder = write_bag(tmp_path / "walk", recorded(), form)
    assert signals(folder, biped) == expected
    if form not in ("mcap-file", "sqlite"):
        return
    bare = tmp_path / f"no 1 of #2?{storage(folder).name}"  # signs that an address would escape
    shutil.copy(storage(folder), bare)
    assert signals(bare, biped) == expected
    (folder / "metadata.yaml").unlink()
    assert signals(folder, biped) == expected


@pytest.mark.parametrize("form", ROS1_FORMS)
def test_a_ros_1_bag_is_the_same_trial(form: str, biped: Robot, bag: Path, tmp_path: Path):
    ros1 = imported(write_ros1(tmp_path / "a.bag", recorded(), form), biped)
    ros2 = imported(bag, biped)

    for signal, values in ros2.trajectory.signals.items():
        assert ros1.trajectory[signal].tobytes() == values.tobytes(), signal
    assert (ros1.qualities, ros1.notes, ros1.origin) == (ros2.qualities, ros2.notes, ros2.origin)


@pytest.mark.parametrize("encoding", ["cdr", "ros1"])
@pytest.mark.parametrize("chunked", [True, False])
def test_other_writers_of_mcap_are_read(
    *, encoding: str, chunked: bool, biped: Robot, expected: dict, tmp_path: Path
):
    path, lz4 = tmp_path / "bag.mcap", CompressionType.LZ4
    write_mcap(path, recorded(), encoding=encoding, compression=lz4, use_chunking=chunked)
    assert signals(path, biped) == expected


@pytest.mark.parametrize("form", ["mcap", "sqlite"])
def test_events_of_services_are_counted_and_change_nothing(
    form: str, biped: Robot, expected: dict, tmp_path: Path
):
    events = [("/add/_service_event", T0 + k, b"\0\1\0\0" + bytes(40)) for k in range(3)]
    folder = write_bag(tmp_path / "walk", [*recorded(), *events], form)
    series = read_bag(folder).series["/add/_service_event"]

    assert (series.count, series.names) == (3, ())
    assert signals(folder, biped) == expected
    with pytest.raises(InputError, match="/joint_states"):
        imported(write_bag(tmp_path / "alone", events, form), biped)


@pytest.mark.parametrize("listed", [True, False])
def test_split_files_are_one_bag(*, listed: bool, biped: Robot, expected: dict, tmp_path: Path):
    items = sorted(recorded(), key=lambda item: item[1])
    whole = tmp_path / "whole"
    whole.mkdir()
    names = []
    for k in range(11):  # in the order of numbers, part_2 is before part_10
        part = [item for n, item in enumerate(items) if n * 11 // len(items) == k]
        source = storage(write_bag(tmp_path / f"part_{k}", part))
        names.append(source.name)
        shutil.move(source, whole / source.name)
    if listed:
        entries = "".join(f"  - old_folder/{name}\n" for name in names)
        (whole / "metadata.yaml").write_text(
            f"rosbag2_bagfile_information:\n  relative_file_paths:\n{entries}"
        )
    os.mkfifo(whole / "a.mcap.pipe")  # waits for nobody

    assert signals(whole, biped) == expected
    digests = read_bag(whole, {}).digests
    assert list(digests) == names
    assert digests[names[0]] == hashlib.sha256((whole / names[0]).read_bytes()).hexdigest()


ABSENT = pytest.mark.skip(reason=f"no bags of ROS 2's own recorder in {GENUINE}")


@pytest.mark.parametrize(
    "path", sorted(GENUINE.glob("*.mcap")) or [pytest.param(GENUINE, marks=ABSENT)], ids=str
)
def test_genuine_recordings_are_read(path: Path, biped: Robot):
    assert sum(series.count for series in read_bag(path).series.values())
    assert "CHANGE: the bag has none" in suggest(path, biped, "b.xml", with_timestep=True)
    with pytest.raises(InputError, match="/joint_states"):
        imported(path, biped)


# ---------------------------------------------------------------- damage


@pytest.mark.parametrize("form", ["sqlite-message", "ros1-none", "ros1-lz4"])
def test_no_damage_crashes(form: str, tmp_path: Path):
    path = (
        write_ros1(tmp_path / "a.bag", recorded(0.1), form[5:])
        if form.startswith("ros1-")
        else storage(write_bag(tmp_path / "bag", recorded(0.1), form))
    )
    data = path.read_bytes()
    for seed in range(9):
        path.write_bytes(spoilt(data, random.Random(seed)))  # noqa: S311 - no secret
        with suppress(InputError):
            read_bag(path)


def test_a_bag_that_is_not_there_is_named(tmp_path: Path):
    bag = write_bag(tmp_path / "bag", recorded(0.1))
    path = storage(bag)
    path.unlink()
    with pytest.raises(InputError, match=r"bag\.mcap"):
        read_bag(bag)
    (bag / "metadata.yaml").unlink()
    with pytest.raises(InputError, match="a folder without one"):
        read_bag(bag)
    with pytest.raises(InputError, match="nothing"):
        read_bag(tmp_path / "nothing")
    path.write_bytes(b"hello")
    with pytest.raises(InputError, match="another file"):
        read_bag(bag)


def test_what_a_recorder_left_beside_its_database_is_read_with_it(tmp_path: Path):
    """A process that is killed leaves its last transactions in another file."""
    database = storage(write_bag(tmp_path / "bag", recorded(0.1), "sqlite"))
    with closing(sqlite3.connect(database)) as recorder:
        recorder.execute("PRAGMA journal_mode=WAL")
        recorder.execute("PRAGMA wal_autocheckpoint=0")
        recorder.execute("DELETE FROM messages WHERE id > 5")
        recorder.commit()
        killed = tmp_path / "killed"
        killed.mkdir()
        for path in database.parent.glob("*.db3*"):
            Path(shutil.copy(path, killed)).chmod(0o444)
    content = {path.name: path.read_bytes() for path in killed.iterdir()}
    assert f"{database.name}-wal" in content

    found = read_bag(killed / database.name)

    assert sum(series.count for series in found.series.values()) == 5
    assert [note.partition(" was not closed")[0] for note in found.notes] == [database.name]
    assert found.digests.keys() == content.keys() - {f"{database.name}-shm"}
    assert {path.name: path.read_bytes() for path in killed.iterdir()} == content  # unchanged


def test_a_journal_that_names_another_file_deletes_nothing(tmp_path: Path):
    """SQLite would roll it back, and delete the file that it names as its super-journal."""
    database = storage(write_bag(tmp_path / "bag", recorded(0.1), "sqlite"))
    victim = tmp_path / "victim"
    victim.write_text("x")
    name, magic = bytes(victim), bytes.fromhex("d9d505f920a163d7")
    pages = struct.pack(">5I", 0, 0, database.stat().st_size // 4096, 512, 4096)
    end = struct.pack(">I", 2**30 // 4096 + 1) + name + struct.pack(">II", len(name), sum(name))
    journal = database.with_name(f"{database.name}-journal")
    journal.write_bytes((magic + pages).ljust(512, b"\0") + end + magic)

    with pytest.raises(InputError, match=f"{journal.name} .*`sqlite3 "):
        read_bag(database)

    assert victim.exists()


@pytest.mark.parametrize("chunked", [True, False])
@pytest.mark.parametrize(("left", "inside"), [(0.6, 5), (0.9, 20)], ids=["frame", "record"])
def test_a_file_that_is_still_growing_is_read_up_to_its_last_whole_message(
    *, chunked: bool, left: float, inside: int, biped: Robot, tmp_path: Path
):
    path = tmp_path / "bag.mcap"
    messages = write_mcap(path, recorded(), chunk_size=2**12, use_chunking=chunked)
    whole = imported(path, biped).trajectory
    data, end = path.read_bytes(), 8
    while end < left * messages:  # a record is an opcode, its length, and so many bytes
        end += 9 + struct.unpack_from("<Q", data, end + 1)[0]
    data = data[: end + inside]
    path.write_bytes(data)

    found = imported(path, biped)

    steps = found.trajectory.steps
    assert (left - 0.15) * whole.steps < steps < whole.steps
    for signal, values in found.trajectory.signals.items():
        np.testing.assert_array_equal(values, whole[signal][:steps])
    assert found.notes[0].startswith("bag.mcap has no end, as one that is still being recorded")
    assert found.digests == {"bag.mcap": hashlib.sha256(data).hexdigest()}
    assert "# Note: bag.mcap has no end" in suggest(path, biped, "b.xml", with_timestep=True)


@pytest.mark.parametrize("form", ["mcap", "mcap-file"])
def test_a_file_of_mcap_is_hashed_while_it_is_read(
    form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    path = storage(write_bag(tmp_path / "bag", recorded(0.1), form))
    monkeypatch.delattr(bags, "file_digest")  # which would read it again, when it may have grown
    assert read_bag(path).digests == {path.name: hashlib.sha256(path.read_bytes()).hexdigest()}


ENDLESS = (
    "DROP TABLE messages; CREATE VIEW messages AS WITH RECURSIVE n(k) AS (SELECT 1 UNION ALL "
    "SELECT k + 1 FROM n) SELECT k AS id, 1 AS topic_id, 0 AS timestamp, x'00' AS data FROM n"
)


@pytest.mark.parametrize(
    "change",
    [
        "UPDATE messages SET topic_id = 77 WHERE id = 3",
        "UPDATE messages SET data = 'text' WHERE id = 3",
        "UPDATE messages SET timestamp = -1 WHERE id = 3",
        "DROP TABLE topics",
        ENDLESS,
    ],
)
def test_impossible_content_of_a_database_is_refused(change: str, tmp_path: Path):
    database = storage(write_bag(tmp_path / "bag", recorded(0.1), "sqlite"))
    with closing(sqlite3.connect(database)) as connection:
        connection.executescript(change)

    with pytest.raises(InputError, match="damaged"):
        read_bag(database)


def a_row_fewer(data: bytearray) -> None:
    """A page of a database with a row fewer, which SQLite reads without an error."""
    page = max(at for at in range(0, len(data), 4096) if data[at] == 13)
    data[page + 4] -= 1


def a_message_fewer(data: bytearray) -> None:
    """A record of MCAP with another type, which the library skips."""
    data[data.index(struct.pack("<HIQ", 1, 0, T0)) - 9] = 0x45


def another_channel(data: bytearray) -> None:
    data[data.index(struct.pack("<HIQ", 1, 0, T0))] = 77


def bytes_after_the_end(data: bytearray) -> None:
    data += b"x"


def cut(data: bytearray) -> None:
    del data[-20:]


def no_index(data: bytearray) -> None:
    """A ROS 1 bag that was not closed."""
    at = data.index(b"index_pos=") + 10
    data[at : at + 8] = bytes(8)


def a_shorter_index(data: bytearray) -> None:
    """An index of one topic without its last message."""
    at = data.index(b"count=", data.rindex(b"op=\x04")) + 6
    (count,) = struct.unpack_from("<I", data, at)
    end = at + 8 + 12 * count
    del data[end - 12 : end]
    data[at : at + 8] = struct.pack("<II", count - 1, 12 * (count - 1))
    # The records after the index stay where they are.
    data[end - 12 : end - 12] = bytes(12)


def a_chunk_twice(data: bytearray) -> None:
    first, second = (match.start() for match in list(re.finditer(rb"chunk_pos=", data))[:2])
    data[second : second + 18] = data[first : first + 18]


@pytest.mark.parametrize(
    ("form", "damage"),
    [
        ("sqlite", a_row_fewer),
        ("plain", a_message_fewer),
        ("plain", another_channel),
        ("mcap", bytes_after_the_end),
        ("ros1", cut),
        ("ros1", no_index),
        ("ros1", a_shorter_index),
        ("ros1", a_chunk_twice),
    ],
)
def test_messages_that_are_missing_are_missed(
    form: str, damage: Callable[[bytearray], None], tmp_path: Path
):
    if form == "plain":  # without chunks, and so without checksums
        path = tmp_path / "plain.mcap"
        write_mcap(path, recorded(0.2), use_chunking=False)
    elif form == "ros1":
        path = write_ros1(tmp_path / "walk.bag", recorded(0.2))
    else:
        path = storage(write_bag(tmp_path / "bag", recorded(0.2), form))
    data = bytearray(path.read_bytes())
    read_bag(path)
    damage(data)
    path.write_bytes(data)

    with pytest.raises(InputError, match="damaged, or ends too early"):
        read_bag(path)


@pytest.mark.process
def test_a_message_that_unpacks_to_a_terabyte_ends_in_one_sentence(tmp_path: Path):
    path = tmp_path / "bag.mcap"
    zeros = zstandard.compress(bytes(2**28))
    kind = array([]).__msgtype__
    # A frame that says that it has 2**40 bytes.
    bomb = b"\x28\xb5\x2f\xfd\xe0" + struct.pack("<Q", 2**40) + zeros[13:]
    payloads = (ROS.serialize_cdr(array([]), kind), bomb)
    write_defined(path, [(Defined("/x", kind), T0, data) for data in payloads])

    with pytest.raises(InputError, match=r"bag\.mcap"):
        read_bag(path)
