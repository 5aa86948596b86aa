"""File for readers that trust the lengths in it."""

from dataclasses import dataclass
from io import BufferedReader, FileIO
from pathlib import Path


class BoundedFile(BufferedReader):
    """File whose ``read`` allocates no more than the rest of the file, for any requested size.

    ``BufferedReader`` allocates the requested size first, so a damaged length would exhaust the
    memory: the damage would be reported as a lack of memory.

    Args:
        path: The file.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(FileIO(path))
        self._end = path.stat().st_size

    def read(self, size: int | None = -1, /) -> bytes:
        """Returns up to ``size`` bytes; all of the rest for a negative size."""
        if size is not None and size > _SMALL:
            size = max(0, min(size, self._end - self.tell()))
        return super().read(size)


_SMALL = 2**16


@dataclass(frozen=True)
class BoundedPath:
    """Path that opens a ``BoundedFile``.

    Attributes:
        path: The file.
    """

    path: Path

    def exists(self) -> bool:
        """Returns whether the file exists."""
        return self.path.exists()

    def open(self, mode: str) -> BoundedFile:
        """Returns the open file; ``mode`` is that of ``Path.open``, and is ``rb``."""
        del mode
        return BoundedFile(self.path)
