"""What can be wrong with a log: one small family, each sentence with the file and the way out."""

import errno
import shlex
from os import PathLike

from selfmodel.errors import WorkError

AGAIN = "make the trial again"
ANOTHER = "give a trial log, NAME.mcap"
IMPORT_IT = "a recording of a robot becomes a trial log with `selfmodel logs import`"
OTHER_VERSION = "read it with the version of selfmodel that wrote it"


_LONGEST = 2000


def salvage_it(path: str | PathLike[str]) -> str:
    """Returns the advice to save what is complete, as a command that can be pasted."""
    name = shlex.quote(str(path))
    return f"save what is complete with `selfmodel logs salvage {name} -o NEW.mcap`"


class LogError(WorkError):
    """A log cannot be used.

    Args:
        path: The file.
        what: What is wrong with it.
        good: How much of it is good; left out where nothing is known.
        advice: What can be done.

    Attributes:
        path: The file.
        what: What is wrong with it.
        good: How much of it is good, or "".
        advice: What can be done.
    """

    def __init__(
        self, path: str | PathLike[str], what: str, *, good: str = "", advice: str = AGAIN
    ) -> None:
        if len(what) > _LONGEST:  # what a log says may be megabytes
            what = f"{what[:_LONGEST]}..."
        self.path, self.what, self.good, self.advice = str(path), what, good, advice
        super().__init__(f"{path}: " + "; ".join(part for part in (what, good, advice) if part))


class NotMcapError(LogError):
    """The file is not MCAP, or too short to tell."""


class TruncatedError(LogError):
    """The file ends before its end: it was cut, or its writer was."""


class CorruptError(LogError):
    """The file's bytes are not those that were written, or contradict each other."""


class UnsupportedError(LogError):
    """The file is sound, but of a kind, version or size that is not known here."""


class IncompleteError(LogError):
    """The trial did not run to its end, and nobody has said so in its log."""


class SchemaMismatchError(LogError):
    """The file is sound, but what stands in it does not fit the format of a trial log."""


class LogWriteError(OSError):
    """A log could not be written on; what had been written stays.

    Args:
        path: The file that was being written.
        cause: What the operating system said.
    """

    def __init__(self, path: str | PathLike[str], cause: OSError) -> None:
        self.reason = cause.strerror or str(cause)
        super().__init__(f"{path}: {_reason(cause)}; what was written before stays in that file")
        self.errno = cause.errno
        self.filename = str(path)

    def __str__(self) -> str:
        return str(self.args[0])


def _reason(cause: OSError) -> str:
    if cause.errno in (errno.ENOSPC, errno.EDQUOT):
        return (
            "the disk is full: free some space, or choose another folder, and make the trial again"
        )
    if cause.errno == errno.EFBIG:
        return "the file has reached the size that this system allows (see ulimit -f)"
    return f"cannot be written: {cause.strerror or cause}"
