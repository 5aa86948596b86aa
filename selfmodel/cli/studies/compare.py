"""``selfmodel compare``: paired comparisons of the methods of a study, as tables and figures."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from selfmodel.cli.arguments.options import Json
from selfmodel.cli.arguments.table_options import METAVAR
from selfmodel.cli.output.printing import print_json, print_lines, print_notes
from selfmodel.cli.output.tables import show
from selfmodel.errors import InputError
from selfmodel.experiments.comparison.files import FOLDER, write_comparison
from selfmodel.experiments.comparison.loaded_study import LoadedStudy, load, whole
from selfmodel.experiments.comparison.table_formats import check_format
from selfmodel.experiments.comparison.tables import (
    interval_text,
    p_text,
    table_of_comparisons,
    table_of_means,
)
from selfmodel.experiments.statistics import Comparison, MarginalMean


def compare(
    study: Annotated[
        Path,
        typer.Argument(
            metavar="STUDY",
            help="Folder of ablate, baseline, paper or suite run; or its results.csv or .jsonl.",
        ),
    ],
    *,
    out: Annotated[
        Path | None,
        typer.Option(
            *("--out", "-o"),
            metavar="DIR",
            help="Folder of the tables and figures.",
            show_default=f"STUDY/{FOLDER}",
        ),
    ] = None,
    table: Annotated[
        str,
        typer.Option("--table", "--table-format", metavar=METAVAR, help="Format of the tables."),
    ] = "csv",
    as_json: Json = False,
) -> None:
    """Compare the methods of a study by pairs: tests, intervals, marginal means, figures.

    Two methods are compared on the physical robots and trials that both had. The p values are
    corrected for the number of pairs in a table by Holm's method. Nothing is run.
    """
    check_format(table)
    if out is None and not study.is_dir():
        raise InputError(f"{study} is no folder of a study: give the folder of the tables, -o DIR")
    found = load(study)
    comparisons, means = found.comparisons(), found.marginal_means()
    files = write_comparison(out or study / FOLDER, found, comparisons, means, table)
    if as_json:
        print_json(_as_dict(found, comparisons, means, files), indent=1)
        return
    _print(found, comparisons, means)
    print_lines(*map(str, files))


def _as_dict(
    study: LoadedStudy,
    comparisons: Sequence[Comparison],
    means: Sequence[MarginalMean],
    files: Sequence[Path],
) -> dict[str, Any]:
    return {
        "study": study.kind,
        "rows": len(study.rows),
        "warnings": list(study.warnings()),
        "comparisons": list(table_of_comparisons(comparisons).records),
        "marginal_means": list(table_of_means(means).records),
        "files": list(map(str, files)),
    }


def _print(
    study: LoadedStudy, comparisons: Sequence[Comparison], means: Sequence[MarginalMean]
) -> None:
    """Prints the tables that are over all conditions; the files have the others too."""
    if not means:
        print_lines(f"{study.path}: {len(study.rows)} rows of one method: nothing to compare")
        return
    print_notes(*(f"warning: {warning}" for warning in study.warnings()))
    for table in dict.fromkeys(one.table for one in whole(means)):
        print_lines(f"{', '.join(table)}:")
        own = table_of_means([one for one in means if one.table == table])
        show(own.columns[1:], [row[1:] for row in own.rows], texts=1)
        print_lines(*(_line(one) for one in comparisons if one.table == table))
    print_lines(
        "Means are over the cells that all methods have. Differences are on the n runs that both "
        "methods have, with 95 % intervals over seeds. p: the larger of a test over runs (exact "
        "McNemar, or sign flips) and one over seeds (Student's), corrected for the number of pairs "
        "(Holm). Better: p below 0.05."
    )


def _line(one: Comparison) -> str:
    pair = f"{one.first} or {one.second}, not decided"
    if one.better:
        pair = f"{one.first} better than {one.second}"
    return f"  {pair}: {interval_text(one.difference)}, n {one.runs}, p {p_text(one.p_holm)}"
