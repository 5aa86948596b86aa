"""The option for the format of the tables of a study."""

from typing import Annotated

import typer

from selfmodel.cli.arguments.options import STUDY
from selfmodel.experiments.comparison.table_formats import FORMATS

METAVAR = "|".join(FORMATS)

_HELP = (
    f"Write the tables in this format too ({', '.join(FORMATS)}), into the folder tables of the "
    f"study."
)

TableFormat = Annotated[
    str | None,
    typer.Option("--table", "--table-format", metavar=METAVAR, help=_HELP, rich_help_panel=STUDY),
]
OtherTableFormat = Annotated[
    str | None,
    typer.Option("--table-format", metavar="FORMAT", help=_HELP, rich_help_panel=STUDY),
]
"""The same for a command with another option ``--table``."""
