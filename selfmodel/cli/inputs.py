"""Option values as objects: cases, lists, shares of a study, names of files."""

from collections.abc import Iterable, Mapping
from pathlib import Path

from selfmodel.errors import InputError
from selfmodel.faults.registry import check_cases
from selfmodel.logs.files import no_folder, refuse_existing


def case_notation(
    robot: str, cases: Mapping[int, str], case: int | None, damage: str | None
) -> str:
    """Returns the notation of a robot's failure, given as a case of Table I or as ``--damage``.

    Raises:
        InputError: Neither or both are given, or there is no case of that number.
    """
    if (case is None) == (damage is None):
        given = "neither" if case is None else "both"
        numbers, example = ", ".join(map(str, cases)), next(iter(cases.values()))
        raise InputError(
            f"expected either --case N or --damage NOTATION, got {given}: cases are {numbers}, a "
            f"notation is like {example}"
        )
    if case is None:
        return str(damage)
    check_cases([case], robot, cases)
    return cases[case]


def texts(option: str, given: str, every: Iterable[str] | None = None) -> tuple[str, ...]:
    """Returns the distinct texts of a list with commas, the value of an option.

    ``every`` has the texts meant by ``all``; None if ``all`` has no meaning.

    Raises:
        InputError: The list or an item of it is empty.
    """
    if every is not None and given.strip() == "all":
        return tuple(every)
    found = [text.strip() for text in given.split(",")]
    if not all(found):
        raise InputError(f"{option} needs a list with commas between its items, got {given!r}")
    return tuple(dict.fromkeys(found))


def whole_numbers(option: str, given: str, every: Iterable[int]) -> tuple[int, ...]:
    """Returns the distinct whole numbers of a list with commas, or all; see ``texts``."""
    items = texts(option, given, map(str, every))
    try:
        return tuple(dict.fromkeys(map(int, items)))
    except ValueError:
        expected = "whole numbers with commas between them, or 'all'"
        raise InputError(f"{option} needs {expected}, got {given!r}") from None


def numbers(option: str, given: str) -> tuple[float, ...]:
    """Returns the distinct numbers of a list with commas; see ``texts``."""
    items = texts(option, given)
    try:
        return tuple(number + 0.0 for number in dict.fromkeys(map(float, items)))  # -0 is 0
    except ValueError:
        expected = "numbers with commas between them, such as 0,0.05"
        raise InputError(f"{option} needs {expected}, got {given!r}") from None


def check_new_file(path: Path, *endings: str) -> None:
    """Checks the name of a file to be written.

    Raises:
        InputError: The name has none of these endings, its folder is missing, or it exists.
    """
    if path.suffix.lower() not in endings:
        expected = " or ".join(filter(None, (", ".join(endings[:-1]), endings[-1])))
        raise InputError(f"--out needs a name that ends in {expected}, got {str(path)!r}")
    if not path.parent.is_dir():
        raise no_folder(path)
    refuse_existing(path)


def is_file(name: str) -> bool:
    """Returns whether a text is a path with an ending, rather than ``package.module:object``."""
    ending = Path(name).suffix
    return bool(ending) and ":" not in ending


def check_log_name(path: Path) -> None:
    """Raises ``InputError`` if the name of a log to be written does not end in ``.mcap``."""
    if path.suffix != ".mcap":
        raise InputError(f"--out needs a name that ends in .mcap, got {str(path)!r}")
