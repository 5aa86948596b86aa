"""``selfmodel logs``: what can be done with logs as files."""

import typer

from selfmodel.cli.logs.import_ import import_
from selfmodel.cli.logs.info import info
from selfmodel.cli.logs.salvage import salvage
from selfmodel.cli.logs.verify import verify

app = typer.Typer(
    name="logs",
    help="Look into trial logs, verify them, salvage damaged ones, import recordings.",
    no_args_is_help=True,
)
app.command()(info)
app.command()(verify)
app.command()(salvage)
app.command("import")(import_)
