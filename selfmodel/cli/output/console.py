"""Rich's console, for tables and progress."""

from rich.console import Console


def text_console(*, stderr: bool = False) -> Console:
    """Returns a console that prints text as it is: names may contain rich's markup.

    Args:
        stderr: Prints on standard error.
    """
    return Console(stderr=stderr, markup=False, highlight=False, emoji=False)
