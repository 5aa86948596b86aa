"""Records of a bag's file in any format: announced topics, and messages as bytes."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from selfmodel.logs.errors import LogError

MAX_LOG_TIME = 2**62
"""Maximum log time of a bag, ns: the year 2116; sums still fit 64 bits."""


@dataclass(frozen=True)
class Announced:
    """Announcement of a topic in a file.

    Attributes:
        topic: Name in the file.
        type: Message type in the file.
        encoding: Encoding of the messages.
    """

    topic: str
    type: str
    encoding: str


@dataclass(frozen=True)
class Stored:
    """Message in a file.

    Attributes:
        announced: Topic of the message.
        time: Log time, ns.
        payload: Bytes of the message, possibly compressed with zstd.
    """

    announced: Announced
    time: int
    payload: bytes


class DamageError(ValueError):
    """The content of a file is impossible."""


def checked_time(time: object) -> int:
    """Returns a valid log time, ns.

    Raises:
        DamageError: The time is invalid.
    """
    if not isinstance(time, int) or not 0 <= time < MAX_LOG_TIME:
        raise DamageError(f"a message has the log time {time!r} ns")
    return time


def explained(
    items: Iterable[Announced | Stored],
    failures: tuple[type[Exception], ...],
    explain: Callable[[Exception, str], LogError],
) -> Iterator[Announced | Stored]:
    """Yields the records of a file, and explains the exceptions of damaged bytes.

    Args:
        items: The records.
        failures: Exceptions that damaged bytes raise.
        explain: Returns the error of an exception and of a text: the number of messages before it.

    Raises:
        LogError: The file is damaged.
    """
    count = 0
    try:
        for item in items:
            count += isinstance(item, Stored)
            yield item
    except failures as failure:
        raise explain(failure, f"{count} messages before that can be read") from failure
