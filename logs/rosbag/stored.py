"""What a bag's file holds, whatever its form: topics that are announced, messages as bytes."""

from dataclasses import dataclass

LATEST = 2**62
"""Log times that a bag may have end here, ns: the year 2116, and sums still fit 64 bits."""


@dataclass(frozen=True)
class Announced:
    """A topic that a file says it has.

    Attributes:
        topic: Its name, as it stands in the file.
        type: The type of its messages, as it stands in the file.
        encoding: How they are encoded: ``cdr`` is the one that can be read.
    """

    topic: str
    type: str
    encoding: str


@dataclass(frozen=True)
class Stored:
    """A message as it stands in a file.

    Attributes:
        topic: Where it was published.
        time: When it was received, ns.
        payload: Its bytes, possibly packed with zstd.
    """

    topic: str
    time: int
    payload: bytes


class DamageError(ValueError):
    """What stands in a file cannot be."""


def checked_time(time: object) -> int:
    """Returns a log time that can be reckoned with, ns.

    Raises:
        DamageError: It is not one.
    """
    if not isinstance(time, int) or not 0 <= time < LATEST:
        raise DamageError(f"a message has the log time {time!r} ns")
    return time
