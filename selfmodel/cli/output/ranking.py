"""A ranking of hypotheses as a table, from its JSON values."""

from collections.abc import Sequence
from typing import Any

from rich.table import Table

from selfmodel.cli.output.plain import plain


def ranking_table(values: Sequence[dict[str, Any]], truth: str | None = None) -> Table:
    """Returns hypotheses as a table, best first; the truth is marked where it is given."""
    table = Table("", "hypothesis", "distance", title="diagnosis")
    table.columns[1].overflow = "fold"
    table.columns[2].justify = "right"
    for rank, one in enumerate(values, start=1):
        mark = " (the truth)" if one["hypothesis"] == truth else ""
        distance = one["distance"]
        table.add_row(
            str(rank),
            plain(one["hypothesis"]) + mark,
            "diverged" if distance is None else f"{distance:.4f}",
        )
    return table
