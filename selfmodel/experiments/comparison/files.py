"""Files of the comparison of a study's methods: tables in a chosen format, and figures."""

from collections.abc import Sequence
from pathlib import Path

from selfmodel.experiments.comparison.difference_figure import paired_differences
from selfmodel.experiments.comparison.loaded_study import LoadedStudy, whole
from selfmodel.experiments.comparison.table_formats import Table, table_file
from selfmodel.experiments.comparison.tables import (
    table_of_comparisons,
    table_of_means,
    table_of_rows,
)
from selfmodel.experiments.statistics import Comparison, MarginalMean
from selfmodel.experiments.study.drawing import files_of
from selfmodel.experiments.study.files import key_of, write_files

FOLDER = "comparison"
"""Folder of the files, in the folder of a study."""


TABLES = "tables"
"""Folder of the tables of a study in another format, in the folder of the study."""


def write_tables(study: Path, tables: Sequence[Table], wanted: str | None) -> tuple[Path, ...]:
    """Writes the tables of a study into its folder ``tables``; returns their paths.

    Args:
        study: Folder of the study.
        tables: The tables; those without a row are left out.
        wanted: Format of the tables, one of ``FORMATS``; None for no files.

    Raises:
        InputError: The format is unknown, or needs a package that is missing.
        LogWriteError: A file cannot be written.
    """
    if wanted is None:
        return ()
    files = dict(table_file(table, wanted) for table in tables if table.records)
    return write_files(study / TABLES, files)


def write_comparison(
    folder: Path,
    study: LoadedStudy,
    comparisons: Sequence[Comparison],
    means: Sequence[MarginalMean],
    table_format: str,
) -> tuple[Path, ...]:
    """Writes the rows, the marginal means, the comparisons, a figure per robot; returns the paths.

    Args:
        folder: Folder of the files, made if missing.
        study: The study.
        comparisons: Its paired comparisons.
        means: Its marginal means.
        table_format: Format of the tables, one of ``FORMATS``.

    Raises:
        InputError: The format needs a package that is missing.
        LogWriteError: A file cannot be written.
    """
    tables = [table_of_rows(study.rows)] if study.rows else []
    if means:
        tables += [table_of_means(means), table_of_comparisons(comparisons)]
    files = dict(table_file(table, table_format) for table in tables)
    for robot in dict.fromkeys(one.table[0] for one in comparisons):
        own = [one for one in whole(comparisons) if one.table[0] == robot]
        files |= files_of(f"differences-{key_of(robot)}", paired_differences(own))
    return write_files(folder, files)
