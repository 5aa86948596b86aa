"""A study: a function at the points of a grid, with rows in one table."""

import itertools
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import quote

from selfmodel.errors import InputError, typed
from selfmodel.files import path_of
from selfmodel.logs.files import make_folder, replace_file
from selfmodel.progress import ignore
from selfmodel.studies.cells import REMEDY, Cell, changed, finished, read_cells, versions_of
from selfmodel.studies.grid import CellEnds, GridBegins, run_grid

RUNS = "runs"
"""Kind of the cells at the points of a study; those that they need have kinds of their own."""

DEFINITION = "study.toml"
"""File of the definition of a study in its folder."""

SHARED = "shared"
"""Parameter of each cell with what all points of a study share."""

Point = Mapping[str, Any]
"""A point of the grid: a value of each axis by its name, as JSON, the seed among them."""

Row = dict[str, Any]
"""Row of a table: the values of the axes, and what the function found there."""


def points_of(**axes: Iterable[Any]) -> dict[str, Point]:
    """Returns all combinations of the values of axes by a name for readers, the last axis fastest.

    The values are JSON.
    """
    points = (dict(zip(axes, values, strict=True)) for values in itertools.product(*axes.values()))
    return {
        "-".join(f"{axis}={quote(str(value), safe='')}" for axis, value in point.items()): point
        for point in points
    }


@typed
@dataclass(frozen=True, eq=False)
class Study:
    """A function at the points of a grid, in a folder from which it is continued.

    Attributes:
        name: Name of the study, such as that of its command.
        folder: Folder of the cells and results; a text is made a path.
        function: The ``Work`` that is computed at each point, as ``package.module:function``; its
            parameters are those of the point, and ``shared``. Its result is a row, a list of rows,
            or lists of rows by the name of a table.
        points: The points by name, in the order in which they are computed.
        shared: Parameters of all points, as JSON: a folder has one set of them.
        needs: Function of a point to the cells whose files it reads, by name.
        definition: The file that defines the study, which is kept in the folder; none if empty.
        modules: Function of a point to the modules of the plug-ins that are called there. Where
            their source, or that of the function, changes, the cells are computed again.
    """

    name: str
    folder: Path
    function: str
    points: Mapping[str, Point]
    shared: Mapping[str, Any] = field(default_factory=dict)
    needs: Callable[[Point], Mapping[str, Cell]] = lambda _point: {}
    definition: bytes = b""
    modules: Callable[[Point], Sequence[str]] = lambda _point: ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "folder", path_of(self.folder, "the folder of a study"))

    def cells(self) -> list[Cell]:
        """Returns the cell of each point, with those that it needs.

        Raises:
            InputError: The folder contains another study, or a run of a point with other inputs.
        """
        shared = {"study": self.name, **self.shared}
        cells = [
            Cell(
                function=self.function,
                name=name,
                parameters={**point, SHARED: shared},
                needs=self.needs(point),
                kind=RUNS,
                modules=self.modules(point),
            )
            for name, point in self.points.items()
        ]
        self._check(cells, shared)
        return cells

    def run(
        self,
        *,
        executor: Executor | None = None,
        workers: int = 1,
        on_event: Callable[[GridBegins | CellEnds], None] = ignore,
        warns: bool = True,
    ) -> tuple[CellEnds, ...]:
        """Computes the unfinished cells, and returns the failed ones; see ``run_grid``."""
        cells = self.cells()
        if self.definition:
            make_folder(self.folder)
            replace_file(self.folder / DEFINITION, self.definition)
        return run_grid(
            self.folder, cells, executor=executor, workers=workers, on_event=on_event, warns=warns
        )

    def rows(self, table: str | None = None) -> list[Row]:
        """Returns the rows of all finished runs in the folder; see ``rows_in``."""
        return rows_in(self.folder, table)

    def _check(self, cells: Sequence[Cell], shared: Mapping[str, Any]) -> None:
        """Checks that the runs in the folder and the cells to compute make one table."""
        places = {cell.name: cell.place for cell in cells}
        models = {cell.parameters.get("robot"): cell.parameters.get("model") for cell in cells}
        here = versions_of(cells)
        for run in read_cells(self.folder / RUNS) if cells else ():
            robot, model = run.parameters.get("robot"), run.parameters.get("model")
            of_model = f"the model of {robot}"
            there = {**run.parameters.get(SHARED, {}), of_model: model}
            if where := _difference(there, {**shared, of_model: models.get(robot, model)}):
                raise InputError(
                    f"{self.folder} contains a study with other settings ({where}): choose another "
                    f"folder"
                )
            place = f"{RUNS}/{run.path.parent.name}"
            same_code = not changed(run.made_with, here)
            if same_code and places.get(run.name, place) != place:
                raise InputError(
                    f"{self.folder} contains {run.name}, made with other inputs, such as another "
                    f"gait: choose another folder, or delete {run.path.parent}"
                )


def rows_in(folder: Path, table: str | None = None) -> list[Row]:
    """Returns the rows of all finished runs in the folder of a study, or those of one table.

    Raises:
        InputError: A cell is damaged, or has no rows.
    """
    rows: list[Row] = []
    for cell in finished(folder / RUNS):
        given, result = cell.parameters, cell.result
        axes = {key: given[key] for key in given if key not in (SHARED, "model")}
        if table and isinstance(result, dict):
            result = result.get(table, [])
        result = result if isinstance(result, list) else [result]
        if not all(isinstance(row, dict) for row in result):
            raise InputError(
                f"{cell.path}: expected rows of a study, got {json.dumps(result)[:80]}; {REMEDY}"
            )
        rows += [{**axes, **row} for row in result]
    return rows


def shared_in(folder: Path) -> Mapping[str, Any]:
    """Returns what the finished runs in a folder share, with the ``study``; nothing without one."""
    first = next(finished(folder / RUNS), None)
    return {} if first is None else dict(first.parameters.get(SHARED, {}))


def grouped(rows: Iterable[Row], *names: str) -> dict[tuple[Any, ...], list[Row]]:
    """Returns rows by their values of some columns, in the order of the first row of each group."""
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row[name] for name in names), []).append(row)
    return groups


def _difference(there: object, requested: object) -> str | None:
    """Returns the first difference of two JSON values as a clause; None if they are equal."""
    old, new = _leaves(there), _leaves(requested)
    for name in sorted(old.keys() | new.keys()):
        if old.get(name) != new.get(name):
            # Values in a file may have megabytes.
            was, wanted = (leaves.get(name, "absent")[:300] for leaves in (old, new))
            return f"{name.strip('.')[:300]} is {was} there, requested is {wanted}"
    return None


def _leaves(value: object, name: str = "") -> dict[str, str]:
    """Returns the values in a JSON value, as JSON texts, by their keys with dots between them."""
    if not isinstance(value, dict) or not value:
        return {name: json.dumps(value, sort_keys=True)}
    leaves = (_leaves(inner, f"{name}.{key}") for key, inner in value.items())
    return {key: text for some in leaves for key, text in some.items()}
