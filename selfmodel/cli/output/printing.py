"""The way out for a command's lines and JSON; ``tables`` and ``console`` use rich.

Every line is one argument. Text of a file or an option therefore cannot begin a line of its own.
"""

import json

import typer

from selfmodel.cli.output.plain import plain


def print_lines(*lines: str) -> None:
    """Prints lines on standard output, each as ``plain`` text."""
    for line in lines:
        typer.echo(plain(line))


def print_notes(*lines: str) -> None:
    """Prints lines on standard error, each as ``plain`` text: notes, progress and errors."""
    for line in lines:
        typer.echo(plain(line), err=True)


def print_json(value: object, *, indent: int | None = 2) -> None:
    """Prints a JSON value on standard output, in ASCII without control characters.

    Args:
        value: The value, without NaN and infinities.
        indent: Indentation of nested values; None for a single line.
    """
    # JSON leaves one control character as it is, and a text is the only place for it.
    typer.echo(json.dumps(value, indent=indent, allow_nan=False).replace("\x7f", "\\u007f"))
