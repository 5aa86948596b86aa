"""``selfmodel suite``: the bodies of dm_control's suite, and one's own beside them."""

import typer

from selfmodel.cli.suite.list_ import list_bodies
from selfmodel.cli.suite.run import run

app = typer.Typer(
    name="suite",
    help="Let the bodies of dm_control's suite fail and recover, beside ours and your own.",
    no_args_is_help=True,
)
app.command("list")(list_bodies)
app.command()(run)
