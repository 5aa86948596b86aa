"""Balance of a table: whether its methods were run in the same cells, equally often."""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from selfmodel.experiments.statistics.outcome import Cell, Outcome, by_table


@dataclass(frozen=True)
class Imbalance:
    """Table whose plain means are of different runs.

    Attributes:
        table: Names of the table.
        runs: Number of runs by method.
        missing: Number of runs by method that another method of the table has and it lacks.
        cells: Fewest and most runs in a cell by method; 0 for a cell that only others have.
    """

    table: Cell
    runs: Mapping[str, int]
    missing: Mapping[str, int]
    cells: Mapping[str, tuple[int, int]]

    @property
    def counts(self) -> str:
        """Number of runs of each method as text."""
        counts = [
            f"{method} {number}" + ("" if low == high else f" ({low} to {high} per cell)")
            for (method, number), (low, high) in zip(
                self.runs.items(), self.cells.values(), strict=True
            )
        ]
        if any(self.missing.values()) and len(set(self.runs.values())) == 1:
            counts.append("not the same runs")
        return ", ".join(counts)


def balance_warnings(found: Iterable[Imbalance]) -> tuple[str, ...]:
    """Returns a sentence for the tables with the same numbers of runs."""
    tables: dict[str, list[str]] = {}
    for one in found:
        tables.setdefault(one.counts, []).append(", ".join(one.table))
    return tuple(
        f"{'; '.join(names)}: the cells are unbalanced (runs: {counts}): compare paired "
        f"differences, not means of all runs; marginal means balance the cells, and not the seeds"
        for counts, names in tables.items()
    )


def imbalances(outcomes: Iterable[Outcome]) -> tuple[Imbalance, ...]:
    """Returns the tables whose methods have different runs, or cells of different size."""
    found = []
    for table, own in by_table(outcomes).items():
        cells = {one.cell for one in own}
        every_run = {one.run for one in own}
        methods: dict[str, list[Outcome]] = {}
        for one in sorted(own, key=lambda one: one.method):
            methods.setdefault(one.method, []).append(one)
        ranges = {}
        for method, mine in methods.items():
            counts = Counter(one.cell for one in mine)
            sizes = [counts[cell] for cell in cells]
            ranges[method] = (min(sizes), max(sizes))
        missing = {
            method: len(every_run - {one.run for one in mine}) for method, mine in methods.items()
        }
        if any(missing.values()) or any(low < high for low, high in ranges.values()):
            runs = {method: len(mine) for method, mine in methods.items()}
            found.append(Imbalance(table, runs, missing, ranges))
    return tuple(found)
