"""Outcome of one method on one physical robot: what the statistics compare."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

from selfmodel.errors import InputError

Cell = tuple[str, ...]

Measure = Literal["share", "number"]
"""Measure of outcomes: ``share``, whose values are 1 and 0 for right and wrong, so that a mean is a
share; or ``number``, such as a distance in metres, whose values may be 0 and 1 too."""


@dataclass(frozen=True)
class Outcome:
    """Value that one method reached in one run.

    Outcomes with the same ``table``, ``cell`` and ``seed`` are of the same physical robot and the
    same trials, so methods are compared by pairs.

    Attributes:
        table: Names of what is compared apart from other outcomes, such as robot and number of
            trials: methods are compared, and their number is corrected for, within one table.
        method: Name of the method, such as a comparator or a baseline.
        cell: Names of the fixed conditions of the run: the gap and the failure.
        seed: Seed of the run. Runs of one seed share gaits and parameters of the physical robot.
        value: 1 or 0 for right or wrong; else a finite number in the unit of the table.
        measure: ``share`` for right and wrong, ``number`` for other values; one in a table.

    Raises:
        InputError: The value is NaN or infinite, or is neither 0 nor 1 in a share.
    """

    table: Cell
    method: str
    cell: Cell
    seed: int
    value: float
    measure: Measure

    def __post_init__(self) -> None:
        """Checks the value."""
        if not math.isfinite(self.value):
            raise InputError(
                f"expected a finite value of {self.method} in {_named(self)}, got {self.value}: "
                f"leave out runs without a value"
            )
        if self.measure == "share" and self.value not in (0, 1):
            raise InputError(
                f"expected 1 or 0 of {self.method} in {_named(self)}, for right or wrong, got "
                f"{self.value}: give the measure 'number'"
            )

    @property
    def run(self) -> tuple[Cell, int]:
        """Run within the table, which all methods share."""
        return self.cell, self.seed


def by_table(outcomes: Iterable[Outcome]) -> dict[Cell, list[Outcome]]:
    """Returns the outcomes of each table, tables in the order of their first outcome."""
    tables: dict[Cell, list[Outcome]] = {}
    for outcome in outcomes:
        tables.setdefault(outcome.table, []).append(outcome)
    return tables


def by_method(outcomes: Sequence[Outcome]) -> dict[str, dict[tuple[Cell, int], float]]:
    """Returns the value of each run by method, methods in the order of their names.

    Raises:
        InputError: A method has two outcomes of one run.
    """
    methods: dict[str, dict[tuple[Cell, int], float]] = {}
    for outcome in sorted(outcomes, key=lambda one: one.method):
        runs = methods.setdefault(outcome.method, {})
        if outcome.run in runs:
            raise InputError(
                f"expected one outcome of {outcome.method} in {_named(outcome)}, got two: compare "
                f"the rows of one study, each once"
            )
        runs[outcome.run] = outcome.value
    return methods


def measure_of(outcomes: Sequence[Outcome]) -> Measure:
    """Returns the measure of the outcomes of one table.

    Args:
        outcomes: The outcomes; at least one.

    Raises:
        InputError: The outcomes have different measures.
    """
    first = outcomes[0]
    other = next((one for one in outcomes if one.measure != first.measure), None)
    if other is not None:
        raise InputError(
            f"expected one measure in the table {', '.join(first.table)}, got a {first.measure} of "
            f"{first.method} and a {other.measure} of {other.method}: name two tables"
        )
    return first.measure


def _named(outcome: Outcome) -> str:
    """Returns the table and the run of an outcome as text."""
    return ", ".join((*outcome.table, *map(str.strip, outcome.cell), f"seed {outcome.seed}"))
