"""Cleanup action of a ``with`` block, run after success and after every exception."""

from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType

from selfmodel.errors import WorkError, describe


@dataclass(frozen=True)
class Cleanup:
    """Context manager that runs an action at the end of its block.

    An exception of the block, such as Ctrl-C, is raised in any case: a failure of the action is
    added to it as a note. After a block without an exception, or in a closed generator, a failure
    of the action is raised itself. ``contextlib.ExitStack`` would replace the exception of the
    block by the failure of the action.

    Attributes:
        action: The action; it may raise ``OSError`` or ``WorkError``.
    """

    action: Callable[[], object]

    def __enter__(self) -> None:
        """Enters the block; there is nothing to acquire."""

    def __exit__(
        self,
        kind: type[BaseException] | None,
        reason: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Runs the action."""
        try:
            self.action()
        except (OSError, WorkError) as failure:
            if reason is None or isinstance(reason, GeneratorExit):
                raise
            reason.add_note(describe(failure))
