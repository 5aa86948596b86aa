"""Lists on the command line: texts and numbers between commas."""

from collections.abc import Iterable

from selfmodel.errors import InputError


def texts(option: str, given: str, every: Iterable[str] | None = None) -> tuple[str, ...]:
    """Returns what stands between the commas, each once.

    Args:
        option: Whose value it is, such as ``--robots``.
        given: What was given.
        every: What ``all`` stands for; None where it stands for nothing.

    Raises:
        InputError: There is nothing, or nothing between two commas.
    """
    if every is not None and given.strip() == "all":
        return tuple(every)
    found = [text.strip() for text in given.split(",")]
    if not all(found):
        raise InputError(f"{option} needs a list with commas between its items, got {given!r}")
    return tuple(dict.fromkeys(found))


def whole_numbers(option: str, given: str, every: Iterable[int]) -> tuple[int, ...]:
    """Returns the whole numbers between the commas, each once; see ``texts``.

    Raises:
        InputError: One is not a whole number.
    """
    try:
        found = [int(text) for text in texts(option, given, map(str, every))]
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            f"{option} needs whole numbers with commas between them, or 'all', got {given!r}"
        ) from None
    return tuple(dict.fromkeys(found))


def numbers(option: str, given: str) -> tuple[float, ...]:
    """Returns the numbers between the commas; see ``texts``.

    Raises:
        InputError: One is not a number.
    """
    try:
        return tuple(dict.fromkeys(float(text) + 0.0 for text in texts(option, given)))
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            f"{option} needs numbers with commas between them, such as 0,0.05, got {given!r}"
        ) from None


def share(option: str, given: str) -> tuple[int, int]:
    """Returns the ``(i, n)`` of ``i/n``, which means every n-th, beginning with the i-th.

    Raises:
        InputError: It is not that.
    """
    first, slash, count = given.partition("/")
    if not (slash and first.isdecimal() and count.isdecimal() and 1 <= int(first) <= int(count)):
        raise InputError(
            f"{option} needs i/n, the i-th of every n runs with i from 1 to n, such as 2/8, "
            f"got {given!r}"
        )
    return int(first), int(count)
