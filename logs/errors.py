"""Errors of a log; each message names the file, the damage and the remedy."""

import errno
import shlex
from os import PathLike

from selfmodel.errors import WorkError

AGAIN = "make the trial again"
IMPORT_IT = "a recording of a robot becomes a trial log with `selfmodel logs import`"
ANOTHER = f"give a trial log, NAME.mcap; {IMPORT_IT}"
GOOD = "its observations are intact"
OTHER_VERSION = "read it with the version of selfmodel that wrote it"

_LONGEST = 2000


def salvage_it(path: str | PathLike[str]) -> str:
    """Returns the advice to salvage a log, with the command to paste."""
    name = shlex.quote(str(path))
    return f"save what is complete with `selfmodel logs salvage {name} -o NEW.mcap`"


class LogError(WorkError):
    """A log cannot be used.

    Attributes:
        path: The file.
        what: Description of the damage.
        good: Description of the intact part, or "".
        advice: Remedy.
    """

    def __init__(
        self, path: str | PathLike[str], what: str, *, good: str = "", advice: str = AGAIN
    ) -> None:
        if len(what) > _LONGEST:  # a text from the log may have megabytes
            what = f"{what[:_LONGEST]}..."
        self.path, self.what, self.good, self.advice = str(path), what, good, advice
        super().__init__(f"{path}: " + "; ".join(part for part in (what, good, advice) if part))


class NotMcapError(LogError):
    """The file is not MCAP, or too short for MCAP."""


class TruncatedError(LogError):
    """The file is truncated."""


class CorruptError(LogError):
    """A checksum of the file is wrong, or its records contradict each other."""


class UnsupportedError(LogError):
    """The file is intact, but has an unsupported format, version or size."""


class IncompleteError(LogError):
    """The trial ended early, and its log has no record of that."""


class SchemaMismatchError(LogError):
    """The file is intact, but its content does not fit the format of a trial log."""


class LogWriteError(OSError):
    """Writing a log failed; the file keeps all earlier data.

    Args:
        path: The file.
        cause: Error of the operating system.
        again: Remedy after some space is free.
        kept: Description of the data that are kept.
    """

    def __init__(
        self,
        path: str | PathLike[str],
        cause: OSError,
        *,
        again: str = AGAIN,
        kept: str = "what was written before stays in that file",
    ) -> None:
        super().__init__(f"{path}: {_reason(cause, again)}; {kept}")
        self.errno = cause.errno
        self.filename = str(path)

    def __str__(self) -> str:
        return str(self.args[0])


def is_full(cause: OSError) -> bool:
    """Returns whether the reason of an error is a full disk, or an exceeded quota."""
    return cause.errno in (errno.ENOSPC, errno.EDQUOT)


def _reason(cause: OSError, again: str) -> str:
    if is_full(cause):
        return f"the disk is full: free some space, or choose another folder, and {again}"
    if cause.errno == errno.EFBIG:
        return "the file has reached the size that this system allows (see ulimit -f)"
    return f"cannot be written: {cause.strerror or cause}"
