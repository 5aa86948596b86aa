"""Tables that lose nothing on a narrow terminal: where one does not fit, its rows are lines."""

from collections.abc import Sequence

import typer
from rich.console import Console
from rich.measure import Measurement
from rich.table import Table


def show(columns: Sequence[str], rows: Sequence[Sequence[str]], *, texts: int = 1) -> None:
    """Prints a table, or what stands in it.

    Args:
        columns: Their titles.
        rows: A text for each column.
        texts: How many of the first columns are texts; the others are numbers.
    """
    table = Table()
    for place, title in enumerate(columns):
        table.add_column(title, justify="left" if place < texts else "right", no_wrap=True)
    for row in rows:
        table.add_row(*row)
    console = Console(markup=False, highlight=False)
    unbounded = console.options.update(width=10_000)
    if Measurement.get(console, unbounded, table).maximum <= console.width:
        console.print(table)
        return
    for row in rows:
        typer.echo(f"{columns[0]}: {row[0]}")
        for title, cell in zip(columns[1:], row[1:], strict=True):
            typer.echo(f"  {title}: {cell}")
