"""Task of the child process that reads a CSV or NPZ file."""

from selfmodel.isolation import Message
from selfmodel.logs.recordings.tables.content import answer
from selfmodel.logs.recordings.tables.csv_file import read_csv
from selfmodel.logs.recordings.tables.npz_file import read_npz


def read(request: Message) -> Message:
    """Reads a table; see ``selfmodel.logs.recordings.tables.content.answer``."""
    compressed = request.header["path"].lower().endswith(".npz")
    return answer(request, read_npz if compressed else read_csv)
