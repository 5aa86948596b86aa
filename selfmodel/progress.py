"""Progress of the stages of a computation, reported to an observer that shows it."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

Item = TypeVar("Item")


@dataclass(frozen=True)
class Progress:
    """Progress of a stage.

    Attributes:
        stage: Name of the stage.
        done: Parts of the stage that are done.
        total: All parts of the stage, which take about the same time each.
    """

    stage: str
    done: float
    total: float


Observer = Callable[[Progress], None]


def ignore(_: object) -> None:
    """Observes nothing."""


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
