"""The errors of selfmodel, and the parts of their sentences."""

import difflib
from collections.abc import Iterable, Sequence


class InputError(ValueError):
    """Invalid input of the user.

    The message is one sentence: the expected input, the actual input, and the remedy. The command
    line prints the message and exits with status 2.
    """


class WorkError(RuntimeError):
    """Failure of an operation on valid input."""


class TrialError(WorkError):
    """A trial that a physical robot could not finish."""


def describe(error: BaseException) -> str:
    """Returns the message of an error with its notes, such as a failed stop of a robot."""
    return "; ".join(filter(None, (str(error), *getattr(error, "__notes__", ()))))


def unknown_name(what: str, name: str, known: Iterable[str]) -> InputError:
    """Returns the error for an unknown name; its message lists the closest known names.

    Args:
        what: The kind of object that was named, such as ``"robot"``.
        name: The unknown name.
        known: Every valid name.
    """
    names = [str(item) for item in known]
    nearest = _nearest(name, names)
    hint = f"did you mean {listed(nearest)}? " if nearest else ""
    return InputError(f"unknown {what} {name!r}: {hint}the known ones are {listed(names)}")


_MOST_COMPARED, _LONGEST_COMPARED = 1000, 200


def _nearest(name: str, names: list[str]) -> list[str]:
    """Returns the most similar names; a file may have too many or too long ones to compare."""
    if len(name) > _LONGEST_COMPARED or len(names) > _MOST_COMPARED:
        return []
    short = [one for one in names if len(one) <= _LONGEST_COMPARED]
    return difflib.get_close_matches(name, short, n=3, cutoff=0.5)


def listed(names: Sequence[str], most: int = 200) -> str:
    """Returns names as part of a sentence: separated by commas, and the number beyond the most."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return (", ".join(names[:most]) or "none") + more


def counted(number: float, noun: str) -> str:
    """Returns a number and its noun in the singular or plural.

    Examples:
        >>> counted(1, "log"), counted(2, "batch")
        ('1 log', '2 batches')
    """
    ending = "" if number == 1 else "es" if noun.endswith("ch") else "s"
    return f"{number} {noun}{ending}"
