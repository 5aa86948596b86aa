"""Records of a bag file of any storage: announced topics, and messages as bytes."""

from dataclasses import dataclass

MAX_LOG_TIME = 2**62
"""Upper bound of log times, ns since 1970: the year 2116; sums of two times fit 64 bits."""


@dataclass(frozen=True)
class Announced:
    """A topic that a file declares.

    Attributes:
        topic: Name of the topic.
        type: Message type, as written in the file.
        encoding: Encoding of the messages; only ``cdr`` can be read.
    """

    topic: str
    type: str
    encoding: str


@dataclass(frozen=True)
class Stored:
    """A message of a file, not decoded.

    Attributes:
        topic: Name of the topic.
        time: Time of reception, ns since 1970.
        payload: Bytes of the message, possibly compressed with zstd.
    """

    topic: str
    time: int
    payload: bytes


class DamageError(ValueError):
    """The content of a file is invalid."""


def checked_time(time: object) -> int:
    """Returns a validated log time, ns.

    Raises:
        DamageError: The time is no whole number from 0 to ``MAX_LOG_TIME``.
    """
    if not isinstance(time, int) or not 0 <= time < MAX_LOG_TIME:
        raise DamageError(f"a message has the log time {time!r} ns")
    return time
