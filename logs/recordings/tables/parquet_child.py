"""Task of the child process that reads a Parquet file.

It has a module of its own, because its server loads pyarrow before it limits a child's memory.
"""

from selfmodel.isolation import Message
from selfmodel.logs.recordings.tables.content import answer
from selfmodel.logs.recordings.tables.parquet_file import read_parquet


def read(request: Message) -> Message:
    """Reads a table; see ``selfmodel.logs.recordings.tables.content.answer``."""
    return answer(request, read_parquet)
