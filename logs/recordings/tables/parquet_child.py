"""Task of the child process that reads a Parquet file.

It has a module of its own, because its server loads pyarrow before it limits a child's memory.
"""

from pathlib import Path

from selfmodel.logs.recordings.tables.content import answer
from selfmodel.logs.recordings.tables.parquet_file import read_parquet
from selfmodel.sandbox.budget import Budget
from selfmodel.sandbox.message import Message


def read(request: Message, budget: Budget, _scratch: Path) -> Message:
    """Reads a table; see ``selfmodel.logs.recordings.tables.content.answer``."""
    return answer(request, budget, read_parquet)
