"""What is done at the end of a block, whatever ends it."""

from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType

from selfmodel.errors import WorkError, describe


@dataclass(frozen=True)
class Ending:
    """A context manager that does something at its end; what ended the block comes first.

    An exception, Ctrl-C too, that ended the block goes on. Where the end itself fails then, that is
    a note to it. Where nothing went wrong, or a generator was closed, it is the error.

    Attributes:
        end: What is done; it may raise ``OSError`` or ``WorkError``.
    """

    end: Callable[[], object]

    def __enter__(self) -> None:
        """Does nothing yet."""

    def __exit__(
        self,
        kind: type[BaseException] | None,
        reason: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Does what is to be done at the end."""
        try:
            self.end()
        except (OSError, WorkError) as failure:
            if reason is None or isinstance(reason, GeneratorExit):
                raise
            reason.add_note(describe(failure))
