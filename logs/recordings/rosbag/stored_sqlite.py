"""Reader of the SQLite file of a bag (``.db3``), the default of ROS 2 up to Humble."""

import shlex
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from functools import partial
from pathlib import Path

from selfmodel.logs.errors import CorruptError, IncompleteError, LogError
from selfmodel.logs.recordings.rosbag.stored import (
    Announced,
    DamageError,
    Stored,
    checked_time,
    explained,
)

SQLITE_MAGIC = b"SQLite format 3\x00"


def read_sqlite(path: Path, name: Path) -> Iterator[Announced | Stored]:
    """Returns the records of a file: topics, then messages in the order of their recording.

    Args:
        path: The file; it is only read.
        name: Name of the file in errors: the name before decompression.

    Raises:
        CorruptError: The file is damaged, or not a rosbag2 recording.
    """
    _refuse_unfinished(path, name)
    return explained(_items(path), _FAILURES, partial(_error, name))


_FAILURES = (
    sqlite3.Error,
    ValueError,  # invalid text, and DamageError
    OverflowError,
)
"""Exceptions of a damaged file."""


def _error(name: Path, failure: Exception, good: str) -> LogError:
    return CorruptError(
        name,
        f"the file is damaged or no rosbag2 recording: {failure}",
        good=good,
        advice="record it again, or recover its intact part with `sqlite3 FILE .recover`",
    )


def _refuse_unfinished(path: Path, name: Path) -> None:
    """Checks that no write-ahead log or rollback journal is beside the file.

    Raises:
        IncompleteError: Such a file exists.
    """
    for suffix in ("-wal", "-journal"):
        beside = path.with_name(path.name + suffix)
        if beside.is_file() and beside.stat().st_size:
            raise IncompleteError(
                name,
                f"its recorder did not close it: {beside.name} has data that are not in it yet",
                advice=f"merge both with `sqlite3 {shlex.quote(str(path))} "
                f"'PRAGMA wal_checkpoint(TRUNCATE)'`",
            )


def _items(path: Path) -> Iterator[Announced | Stored]:
    # Immutable: SQLite cannot create its lock files on a read-only disk.
    address = f"{path.resolve().as_uri()}?mode=ro&immutable=1"
    with closing(sqlite3.connect(address, uri=True)) as database:
        _check_tables(database)
        # Reading a page that is damaged may skip its messages silently.
        (verdict,) = database.execute("PRAGMA quick_check(1)").fetchone()
        if verdict != "ok":
            raise DamageError(str(verdict))
        topics: dict[int, Announced] = {}
        for number, *texts in database.execute(
            "SELECT id, name, type, serialization_format FROM topics ORDER BY id"
        ):
            if not all(isinstance(text, str) for text in texts):
                raise DamageError(f"the description of topic {number!r} is not text")
            topics[number] = Announced(*texts)
            yield topics[number]
        for number, time, payload in database.execute(
            "SELECT topic_id, timestamp, data FROM messages ORDER BY id"
        ):
            if number not in topics or not isinstance(payload, bytes):
                raise DamageError(f"a message of topic {number!r} with {type(payload).__name__}")
            yield Stored(topics[number], checked_time(time), payload)


def _check_tables(database: sqlite3.Connection) -> None:
    """Checks that the rows are stored: those of a view may be computed without end.

    Raises:
        DamageError: A table is a view, or virtual, or has computed columns.
    """
    for table in ("topics", "messages"):
        (computed,) = database.execute(
            "SELECT (SELECT count(*) FROM pragma_table_xinfo(:name) WHERE hidden)"
            " + (SELECT count(*) FROM sqlite_schema WHERE name = :name AND NOT rootpage)",
            {"name": table},
        ).fetchone()
        if computed:
            raise DamageError(f"{table} has computed rows")
