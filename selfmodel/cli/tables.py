"""Tables and consoles of rich, which keep every character on a narrow terminal."""

from collections.abc import Iterable, Sequence
from typing import Any

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


def folding(
    columns: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    title: str = "",
    texts: int | None = None,
    no_wrap: bool = False,
) -> Table:
    """Returns a table whose cells are wrapped where they are too wide, but for ``no_wrap``.

    The first ``texts`` columns, or all, are left-justified texts, the others numbers.
    """
    table = Table(title=plain(title) or None)
    for place, name in enumerate(columns):
        is_text = texts is None or place < texts
        table.add_column(
            name, justify="left" if is_text else "right", overflow="fold", no_wrap=no_wrap
        )
    for row in rows:
        table.add_row(*map(plain, row))
    return table


def print_tables(*tables: Table) -> None:
    """Prints tables on standard output."""
    text_console().print(*tables)


def show(columns: Sequence[str], rows: Iterable[Sequence[str]], *, texts: int = 1) -> None:
    """Prints a table as ``folding``; if it is too wide, each row as one line per cell."""
    rows = list(rows)
    table = folding(columns, rows, texts=texts, no_wrap=True)
    console = text_console()
    unbounded = console.options.update(width=10_000)
    if Measurement.get(console, unbounded, table).maximum <= console.width:
        console.print(table)
        return
    for row in rows:
        cells = zip(columns[1:], row[1:], strict=True)
        print_lines(f"{columns[0]}: {row[0]}", *(f"  {title}: {cell}" for title, cell in cells))


def ranking_table(values: dict[str, Any], truth: str | None = None) -> Table:
    """Returns the hypotheses of a diagnosis, as JSON values; a given truth is marked."""
    known = values["probability"]
    rows = [
        (
            str(rank),
            one["hypothesis"] + (" (the truth)" if one["hypothesis"] == truth else ""),
            "diverged" if one["distance"] is None else f"{one['distance']:.4f}",
            f"{known[one['hypothesis']]:.2f}" if one["hypothesis"] in known else "",
        )
        for rank, one in enumerate(values["diagnosis"], start=1)
    ]
    columns = ("", "hypothesis", "distance", "probability")
    return folding(columns, rows, title="diagnosis", texts=2)
