"""Progress of the stages of a computation, reported to an observer that shows it."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any, TypeVar

Item = TypeVar("Item")


@dataclass(frozen=True)
class Progress:
    """Progress of a stage, in parts of about the same time; its text is a line with the time left.

    The seconds are wall time since the start of the stage.
    """

    stage: str
    done: float
    total: float
    seconds: float = 0.0

    def __str__(self) -> str:
        left = time_left(self.done / self.total, self.seconds)
        return ", ".join(filter(None, (f"{self.stage}: {self.done / self.total:.0%}", left)))


Observer = Callable[[Progress], None]


def ignore(_: object) -> None:
    """Observes nothing."""


def timed(observer: Callable[[Any], None]) -> Callable[[Any], None]:
    """Returns an observer that hands events on, each ``Progress`` with the time of its stage."""
    stage, start = "", 0.0

    def observe(event: object) -> None:
        nonlocal stage, start
        if isinstance(event, Progress):
            if event.stage != stage or not event.done:
                stage, start = event.stage, perf_counter()
            event = replace(event, seconds=perf_counter() - start)
        observer(event)

    return observe


def time_left(share: float, seconds: float) -> str:
    """Returns the time left as text, of a stage of which a share is done; nothing if unknown.

    Examples:
        >>> time_left(0.25, 20.0)
        'about 1 min 00 s left'
    """
    if not (0 < share < 1 and seconds > 0):
        return ""
    minutes, left = divmod(max(round(seconds * (1 - share) / share), 1), 60)
    return f"about {minutes} min {left:02d} s left" if minutes else f"about {left} s left"


def followed(
    items: Sequence[Item], stage: str, observer: Observer, *, before: int = 0, parts: int = 1
) -> Iterator[Item]:
    """Yields items, and reports how many are done: before the first, and after each.

    All items together are one of the ``parts`` of the stage, of which some are done ``before``.
    """
    for number, item in enumerate(items):
        observer(Progress(stage, before + number / len(items), parts))
        yield item
    observer(Progress(stage, before + 1, parts))
