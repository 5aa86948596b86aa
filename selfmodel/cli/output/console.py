"""Rich's console, for tables and progress."""

from rich.console import Console

NARROWEST = 20
"""Smallest width of a terminal, in columns. A terminal that reports less, such as 0 in a container,
reports no width: rich would print nothing of a table, or a character a line."""

WIDTH = 80
"""Width of a terminal that reports none, in columns."""


def text_console(*, stderr: bool = False) -> Console:
    """Returns a console that prints text as it is: names may contain rich's markup.

    Args:
        stderr: Prints on standard error.
    """
    console = Console(stderr=stderr, markup=False, highlight=False, emoji=False)
    if console.width < NARROWEST:
        console.width = WIDTH
    return console
