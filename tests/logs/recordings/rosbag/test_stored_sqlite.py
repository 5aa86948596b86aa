import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from selfmodel.logs.errors import CorruptError
from selfmodel.logs.recordings.rosbag.stored import Stored
from selfmodel.logs.recordings.rosbag.stored_sqlite import read_sqlite
from tests.logs.recordings.conftest import recorded
from tests.logs.recordings.rosbag.bags import storage, write_bag

PAGE = 4096
LEAF = 13
"""First byte of a page with rows of a table."""


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    return storage(write_bag(tmp_path / "bag", recorded(0.3), "sqlite"))


def messages(path: Path) -> int:
    return sum(isinstance(item, Stored) for item in read_sqlite(path, path))


def rows(path: Path) -> int:
    with closing(sqlite3.connect(path)) as database:
        return len(database.execute("SELECT data FROM messages ORDER BY id").fetchall())


def test_rows_that_a_damaged_page_lacks_are_missed(recording: Path):
    before = messages(recording)
    data = bytearray(recording.read_bytes())
    page = max(at for at in range(0, len(data), PAGE) if data[at] == LEAF)
    data[page + 4] -= 1  # the number of rows in the page
    recording.write_bytes(data)

    assert rows(recording) == before - 1  # SQLite reads the rest
    with pytest.raises(CorruptError, match="the file is damaged or no rosbag2 recording"):
        messages(recording)


COPIES = (
    "ALTER TABLE messages RENAME TO m;"
    "CREATE VIEW messages AS SELECT a.id, a.topic_id, a.timestamp, a.data FROM m a, m b, m c"
)
"""A view with millions of rows."""


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ("UPDATE messages SET topic_id = 77 WHERE id = 3", "a message of topic 77"),
        ("UPDATE messages SET data = 'text' WHERE id = 3", "a message of topic .* with str"),
        ("UPDATE messages SET timestamp = -1 WHERE id = 3", "the log time -1 ns"),
        ("UPDATE topics SET type = x'00' WHERE id = 1", "the description of topic 1 is not text"),
        ("DROP TABLE messages", "no such table: messages"),
        ("DROP TABLE topics", "no such table: topics"),
        (COPIES, "messages has computed rows"),
        ("ALTER TABLE topics ADD COLUMN more AS (hex(id))", "topics has computed rows"),
    ],
)
def test_impossible_content_is_refused(change: str, sentence: str, recording: Path):
    with closing(sqlite3.connect(recording)) as database:
        database.executescript(change)

    with pytest.raises(CorruptError, match=sentence):
        messages(recording)
