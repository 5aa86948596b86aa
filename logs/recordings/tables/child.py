"""Task of the child process that reads a CSV or NPZ file."""

from pathlib import Path

from selfmodel.logs.recordings.tables.content import answer
from selfmodel.logs.recordings.tables.csv_file import read_csv
from selfmodel.logs.recordings.tables.npz_file import read_npz
from selfmodel.sandbox.budget import Budget
from selfmodel.sandbox.message import Message


def read(request: Message, budget: Budget, _scratch: Path) -> Message:
    """Reads a table; see ``selfmodel.logs.recordings.tables.content.answer``."""
    compressed = request.facts["path"].lower().endswith(".npz")
    return answer(request, budget, read_npz if compressed else read_csv)
