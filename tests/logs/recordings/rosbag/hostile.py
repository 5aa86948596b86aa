"""Small bags whose content takes much memory or time."""

import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import Channel, Chunk, DataEnd, Footer, Header, McapRecord, Message, Schema

from tests.logs.recordings.conftest import recorded
from tests.logs.recordings.rosbag.bags import ROS, T0, array, storage, write_bag

MAGIC = b"\x89MCAP0\r\n"
ARRAY = "std_msgs/msg/Float64MultiArray"
COMMANDS = 1
"""Channel of a topic that the mapping of the tests names."""


def many_numbers(folder: Path) -> Path:
    """A message of 3 million numbers in 1 kB of zstd."""
    payload = bytes(ROS.serialize_cdr(array(np.zeros(3_000_000)), ARRAY))
    return _mcap(folder, Message(COMMANDS, T0, zstandard.compress(payload), T0, 0))


def many_messages(folder: Path) -> Path:
    """A chunk of 256 MB of empty messages in 24 kB of zstd."""
    one = _bytes(Message(COMMANDS, T0, b"", T0, 0))
    data = one * (256 * 10**6 // len(one))
    chunk = Chunk("zstd", zstandard.compress(data), T0, T0, 0, len(data))
    return _mcap(folder, chunk)


def generated_column(folder: Path) -> Path:
    """Messages that SQLite computes as they are read, 200 MB each."""
    path = storage(write_bag(folder / "bag", recorded(0.2), "sqlite"))
    with closing(sqlite3.connect(path)) as database:
        database.executescript(
            """
            DROP TABLE messages;
            CREATE TABLE messages(
                id INTEGER PRIMARY KEY,
                topic_id INTEGER,
                timestamp INTEGER,
                data BLOB GENERATED ALWAYS AS (CAST(hex(zeroblob(100000000)) AS BLOB))
            );
            INSERT INTO topics VALUES (99, '/other', '', 'cdr', '', '');
            WITH RECURSIVE n(k) AS (SELECT 1 UNION ALL SELECT k + 1 FROM n WHERE k < 1000)
            INSERT INTO messages(topic_id, timestamp) SELECT 99, k FROM n;
            VACUUM;
            """
        )
    return path


def endless_view(folder: Path) -> Path:
    """A view in place of the table of messages, whose rows never end."""
    path = storage(write_bag(folder / "bag", recorded(0.1), "sqlite"))
    with closing(sqlite3.connect(path)) as database:
        database.executescript(
            """
            DROP TABLE messages;
            CREATE VIEW messages AS
            WITH RECURSIVE n(k) AS (SELECT 1 UNION ALL SELECT k + 1 FROM n)
            SELECT k AS id, 1 AS topic_id, 0 AS timestamp, x'00' AS data FROM n;
            VACUUM;
            """
        )
    return path


def packed_file(folder: Path) -> Path:
    """A file of 500 MB in 50 kB of zstd."""
    path = folder / "bag.mcap.zstd"
    path.write_bytes(zstandard.compress(bytes(5 * 10**8)))
    return path


def _mcap(folder: Path, record: McapRecord) -> Path:
    """A short honest recording, and then a record."""
    records: list[McapRecord] = [Header("ros2", "")]
    channels: dict[str, int] = {}
    items = sorted(recorded(0.1), key=lambda item: item[0] != "/commands")
    for topic, time, message in items:
        kind = message.__msgtype__
        if topic not in channels:
            channel = channels.setdefault(topic, COMMANDS + len(channels))
            records.append(Schema(channel, b"", "ros2msg", kind))
            records.append(Channel(channel, topic, "cdr", {}, channel))
        payload = bytes(ROS.serialize_cdr(message, kind))
        records.append(Message(channels[topic], time, payload, time, 0))
    path = folder / "hostile.mcap"
    data = b"".join(map(_bytes, [*records, record, DataEnd(0), Footer(0, 0, 0)]))
    path.write_bytes(MAGIC + data + MAGIC)
    return path


def _bytes(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())
