"""Standard streams that may be closed, full or without a reader.

Results are on standard output: a failure to write them is an error. Messages and progress are on
standard error: a failure to write them changes neither the result nor the exit status.
"""

import io
import os
import sys
from contextlib import suppress
from typing import TYPE_CHECKING, TextIO

from selfmodel.errors import WorkError

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

STDIN, STDOUT, STDERR = 0, 1, 2


def open_streams() -> None:
    """Opens the standard streams of this process again, unless its caller has replaced them.

    A closed descriptor is opened on the null device. Otherwise the next file would get its number,
    and C libraries, which write their messages to descriptor 2, would write into a log.
    """
    for descriptor, mode in ((STDIN, os.O_WRONLY), (STDOUT, os.O_RDONLY), (STDERR, os.O_WRONLY)):
        _open_closed(descriptor, mode)
    if sys.stdout is sys.__stdout__:
        sys.stdout = _text(_Results(STDOUT, "w", closefd=False), sys.__stdout__, "strict")
    if sys.stderr is sys.__stderr__:
        sys.stderr = _text(
            _Messages(STDERR, "w", closefd=False), sys.__stderr__, "backslashreplace"
        )


def flush_output() -> None:
    """Writes the rest of the results.

    Raises:
        WorkError: Standard output is closed or full.
        BrokenPipeError: Standard output has no reader.
    """
    try:
        sys.stdout.flush()
    except (OSError, WorkError):
        # The interpreter would report the same failure again as it exits.
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, STDOUT)
        os.close(null)
        raise


class _Results(io.FileIO):
    """Standard output; its errors have its name."""

    def write(self, data: "ReadableBuffer", /) -> int:
        try:
            return super().write(data)
        except BrokenPipeError:
            raise
        except OSError as error:
            raise WorkError(f"standard output could not be written: {error.strerror}") from error


class _Messages(io.FileIO):
    """Standard error; text that cannot be written is lost."""

    def write(self, data: "ReadableBuffer", /) -> int:
        with suppress(OSError):
            return super().write(data)
        return memoryview(data).nbytes


def _open_closed(descriptor: int, mode: int) -> None:
    try:
        os.fstat(descriptor)
    except OSError:
        null = os.open(os.devnull, mode)
        if null == descriptor:
            os.set_inheritable(null, True)
        else:
            os.dup2(null, descriptor)
            os.close(null)


def _text(raw: io.FileIO, before: TextIO | None, errors: str) -> io.TextIOWrapper:
    return io.TextIOWrapper(
        io.BufferedWriter(raw),
        encoding=None if before is None else before.encoding,
        errors=(before and before.errors) or errors,
        line_buffering=raw.fileno() == STDERR or raw.isatty(),
    )
