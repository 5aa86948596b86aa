"""Tables that keep every character on a narrow terminal."""

from collections.abc import Iterable, Sequence
from typing import Literal

from rich.measure import Measurement
from rich.table import Table

from selfmodel.cli.output.console import text_console
from selfmodel.cli.output.plain import plain
from selfmodel.cli.output.printing import print_lines


def show(columns: Sequence[str], rows: Sequence[Sequence[str]], *, texts: int = 1) -> None:
    """Prints a table; if it is too wide, each row as one line per cell.

    Args:
        columns: Titles of the columns.
        rows: A text per column.
        texts: Number of leading columns that are left-justified texts; the others are numbers.
    """
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
        print_lines(
            f"{columns[0]}: {row[0]}",
            *(f"  {title}: {cell}" for title, cell in zip(columns[1:], row[1:], strict=True)),
        )


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
