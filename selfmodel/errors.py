"""The errors that a user meets, and the sentence for a name nobody knows."""

import difflib
from collections.abc import Iterable


class InputError(ValueError):
    """What a user gave cannot be used.

    The message is one sentence that says what was expected, what came, and how to mend it; the
    command line prints it as it is and exits with status 2.
    """


class WorkError(RuntimeError):
    """The work could not be done, through no fault of what the user gave."""


class TrialError(WorkError):
    """A physical robot could not finish a trial."""


def in_words(error: BaseException) -> str:
    """Returns what an error says, its notes too: that a robot was not stopped is only in a note."""
    return "; ".join(filter(None, (str(error), *getattr(error, "__notes__", ()))))


def unknown_name(what: str, name: str, known: Iterable[str]) -> InputError:
    """Returns the error for a name that is none of ``known``, with the nearest of them.

    Args:
        what: What the name should have named, such as ``"robot"``.
        name: What came.
        known: Every valid name.
    """
    names = [str(item) for item in known]
    nearest = difflib.get_close_matches(name, names, n=3, cutoff=0.5)
    hint = f"did you mean {_listed(nearest)}? " if nearest else ""
    return InputError(f"unknown {what} {name!r}: {hint}the known ones are {_listed(names)}")


def _listed(names: list[str]) -> str:
    return ", ".join(names) if names else "none"
