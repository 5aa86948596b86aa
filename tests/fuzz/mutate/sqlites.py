"""Mutations of a rosbag2 SQLite file: rows, columns, tables, and pages."""

import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np

from tests.fuzz.mutate import cdrs, data as raw
from tests.fuzz.mutate.numbers import INTEGERS, text

SCHEMA = (
    *("DROP TABLE messages", "DROP TABLE topics", "DELETE FROM messages", "DELETE FROM topics"),
    *("ALTER TABLE messages RENAME TO m", "ALTER TABLE messages RENAME COLUMN data TO d"),
    "ALTER TABLE topics RENAME TO t; CREATE VIEW topics AS SELECT * FROM t",
    "ALTER TABLE messages RENAME TO m; CREATE VIEW messages AS SELECT a.* FROM m a, m b, m c",
    "ALTER TABLE messages RENAME data TO d; ALTER TABLE messages ADD data AS (zeroblob(1000000))",
    "ALTER TABLE messages RENAME timestamp TO s; ALTER TABLE messages ADD timestamp AS (abs(-1.5))",
    "CREATE TRIGGER x AFTER INSERT ON messages BEGIN DELETE FROM messages; END",
    "CREATE INDEX i ON messages (data)",
    "INSERT INTO topics SELECT id + 100, name, type, serialization_format, '' FROM topics",
    "INSERT INTO messages SELECT id + 5000, topic_id, timestamp, data FROM messages",
    "PRAGMA user_version = -1; PRAGMA application_id = 7",
    "PRAGMA auto_vacuum = FULL; VACUUM",
    "PRAGMA encoding = 'UTF-16'; VACUUM",
)
MESSAGES = 80
"""Rows of the table of messages that are changed, from the first one."""

VALUES = (
    *("NULL", "''", "x'00'", "x'28b52ffd'", "'text'", "1.5", "-1", "9e999", "-9e999"),
    *("9223372036854775807", "-9223372036854775808", "4611686018427387904", "zeroblob(100000)"),
)


def mutated(path: Path, rng: np.random.Generator) -> tuple[bytes, str]:
    """Changes a copy of a file in place, and returns its bytes and the mutations."""
    if rng.random() < 0.2:
        return raw.mutated(path.read_bytes(), rng)
    names = []
    with closing(sqlite3.connect(path, isolation_level=None)) as database:
        database.execute("PRAGMA journal_mode = MEMORY")
        database.execute("PRAGMA synchronous = OFF")
        for _ in range(int(rng.integers(1, 4))):
            try:
                names.append(_change(database, rng))
            except (sqlite3.Error, OverflowError) as error:  # an earlier mutation
                names.append(f"refused by SQLite: {error}")
    return path.read_bytes(), "; ".join(names)


def _change(database: sqlite3.Connection, rng: np.random.Generator) -> str:
    kind = int(rng.integers(6))
    message, topic = int(rng.integers(1, MESSAGES)), int(rng.integers(1, 6))
    if kind == 0:
        script = SCHEMA[rng.integers(len(SCHEMA))]
        database.executescript(script)
        return script
    if kind in (1, 2):
        held = database.execute("SELECT data FROM messages WHERE id = ?", (message,)).fetchone()
        whole = held[0] if held and isinstance(held[0], bytes) else b"\x00\x01\x00\x00"
        payload, what = cdrs.mutated(whole, rng)
        database.execute("UPDATE messages SET data = ? WHERE id = ?", (payload, message))
        return f"message {message}: {what}"
    if kind == 3:
        column = ("topic_id", "timestamp", "data", "id")[rng.integers(4)]
        value = VALUES[rng.integers(len(VALUES))]
        if rng.random() < 0.5:
            value = str(INTEGERS[rng.integers(len(INTEGERS))])
        where = "" if rng.random() < 0.1 and column != "id" else f" WHERE id = {message}"
        statement = f"UPDATE messages SET {column} = {value}{where}"  # noqa: S608  # our own values
        database.execute(statement)
        return statement
    column = ("name", "type", "serialization_format", "id")[rng.integers(4)]
    new: object = text(rng) if column != "id" else int(rng.integers(0, 9))
    if rng.random() < 0.2:
        new = (None, b"\xff\xfe", 1.5)[rng.integers(3)]
    database.execute(f"UPDATE topics SET {column} = ? WHERE id = ?", (new, topic))  # noqa: S608  # our own columns
    return f"topic {topic}: {column} = {new!r:.60}"
