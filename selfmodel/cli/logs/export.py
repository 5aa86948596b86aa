"""``selfmodel logs export``: the signals of a trial log as a table."""

from pathlib import Path
from typing import Annotated

import typer

from selfmodel import arguments
from selfmodel.cli.arguments.options import Json
from selfmodel.cli.output.plain import counted
from selfmodel.cli.output.printing import print_json, print_lines
from selfmodel.logs.export import export as write_table, writer_of
from selfmodel.logs.files import refuse_existing


def export(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="Log of a trial.")],
    *,
    out: Annotated[
        Path,
        typer.Option(
            *("--out", "-o"),
            metavar="FILE",
            help="Table to write, .csv, .npz or .parquet; it must not exist.",
        ),
    ],
    as_json: Json = False,
) -> None:
    """Write the signals of a trial log as a table: one row per control step."""
    writer_of(out)
    refuse_existing(out)
    (found,) = arguments.read_logs([log])
    behaviour = found.trial.behaviour
    names = write_table(out, behaviour)
    if as_json:
        print_json({"table": str(out), "rows": behaviour.steps, "columns": list(names)})
    else:
        print_lines(f"{counted(behaviour.steps, 'row')} of {counted(len(names), 'column')}: {out}")
