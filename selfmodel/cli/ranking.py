"""A diagnosis as plain values and as a table."""

import math
from collections.abc import Sequence
from typing import Any

from rich.table import Table

from selfmodel.diagnosis import Candidate


def as_values(ranked: Sequence[Candidate]) -> list[dict[str, Any]]:
    """Returns hypotheses with their distances, as JSON has them: null where one diverged."""
    return [
        {
            "hypothesis": str(candidate.hypothesis),
            "distance": candidate.distance if math.isfinite(candidate.distance) else None,
        }
        for candidate in ranked
    ]


def ranking_table(values: Sequence[dict[str, Any]], truth: str | None = None) -> Table:
    """Returns hypotheses as a table, best first, the truth marked where it is known."""
    table = Table("", "hypothesis", "distance", title="diagnosis")
    table.columns[1].overflow = "fold"
    table.columns[2].justify = "right"
    for rank, one in enumerate(values, start=1):
        mark = " (the truth)" if one["hypothesis"] == truth else ""
        distance = one["distance"]
        table.add_row(
            str(rank),
            one["hypothesis"] + mark,
            "diverged" if distance is None else f"{distance:.4f}",
        )
    return table
