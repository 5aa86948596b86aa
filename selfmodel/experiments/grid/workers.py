"""Workers of a study: an executor, and the number of cells that it has at a time."""

from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor
from contextlib import AbstractContextManager
from dataclasses import dataclass


def _no_check() -> None:
    """Checks nothing: the workers have the installation of the command, or report theirs."""


@dataclass(frozen=True)
class Workers:
    """Executor of cells.

    Attributes:
        executor: The executor. Its workers can import selfmodel, and the folder of the study has
            the same path there.
        at_once: Number of cells that are submitted at a time.
        exits: Errors of a call whose worker exited.
        attempts: Attempts to compute a cell whose worker exits, which may have another reason than
            the cell.
        last_alone: Whether the last attempt has no other cell beside it: where a worker has several
            cells, all of them are lost with it.
        check: Called after a call that failed, and while none answers; raises ``InputError`` if a
            worker has other versions than the command, or none.
    """

    executor: Executor
    at_once: int
    exits: tuple[type[BaseException], ...] = (BrokenExecutor,)
    attempts: int = 3
    last_alone: bool = False
    check: Callable[[], None] = _no_check


OpenWorkers = AbstractContextManager[Workers]
"""Workers that are started where they are needed, and stopped."""
