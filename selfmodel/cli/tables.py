"""Tables and consoles of rich, which keep every character on a narrow terminal."""

from collections.abc import Iterable, Sequence
from typing import Any, Literal

from rich.console import Console
from rich.measure import Measurement
from rich.table import Table

from selfmodel.cli.output import plain, print_lines

NARROWEST, WIDTH = 20, 80
"""Smallest width of a terminal, in columns, and that of one that reports less, such as 0 in a
container: rich would print nothing of a table, or a character a line."""


def text_console(*, stderr: bool = False) -> Console:
    """Returns a console that prints text as it is: names may contain rich's markup."""
    console = Console(stderr=stderr, markup=False, highlight=False, emoji=False)
    if console.width < NARROWEST:
        console.width = WIDTH
    return console


def show(columns: Sequence[str], rows: Iterable[Sequence[str]], *, texts: int = 1) -> None:
    """Prints a table; if it is too wide, each row as one line per cell.

    Args:
        columns: Titles of the columns.
        rows: A text per column.
        texts: Number of leading columns that are left-justified texts; the others are numbers.
    """
    rows = list(rows)
    table = Table()
    for place, title in enumerate(columns):
        table.add_column(title, justify="left" if place < texts else "right", no_wrap=True)
    for row in rows:
        table.add_row(*map(plain, row))
    console = text_console()
    unbounded = console.options.update(width=10_000)
    if Measurement.get(console, unbounded, table).maximum <= console.width:
        console.print(table)
        return
    for row in rows:
        cells = zip(columns[1:], row[1:], strict=True)
        print_lines(f"{columns[0]}: {row[0]}", *(f"  {title}: {cell}" for title, cell in cells))


def folding(
    columns: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    title: str | None = None,
    texts: int | None = None,
) -> Table:
    """Returns a table whose cells are wrapped where they are too wide.

    Args:
        columns: Titles of the columns.
        rows: A text per column.
        title: Title of the table.
        texts: Number of leading columns that are left-justified texts; None for all.
    """
    table = Table(title=plain(title) if title else None)
    for place, name in enumerate(columns):
        justify: Literal["left", "right"] = "left" if texts is None or place < texts else "right"
        table.add_column(name, overflow="fold", justify=justify)
    for row in rows:
        table.add_row(*map(plain, row))
    return table


def print_tables(*tables: Table) -> None:
    """Prints tables on standard output."""
    text_console().print(*tables)


def ranking_table(values: Sequence[dict[str, Any]], truth: str | None = None) -> Table:
    """Returns hypotheses, as JSON values, best first; the truth is marked where it is given."""
    rows = [
        (
            str(rank),
            one["hypothesis"] + (" (the truth)" if one["hypothesis"] == truth else ""),
            "diverged" if one["distance"] is None else f"{one['distance']:.4f}",
        )
        for rank, one in enumerate(values, start=1)
    ]
    return folding(("", "hypothesis", "distance"), rows, title="diagnosis", texts=2)
