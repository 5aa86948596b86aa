"""The command line: one file a command."""

import sys

import typer

from selfmodel.cli import logs, suite
from selfmodel.cli.ablate import ablate
from selfmodel.cli.calibrate import calibrate
from selfmodel.cli.diagnose import diagnose
from selfmodel.cli.output.plain import plain
from selfmodel.cli.recover import recover
from selfmodel.cli.render import render
from selfmodel.cli.replay import replay
from selfmodel.cli.robots import robots
from selfmodel.cli.trial import trial
from selfmodel.errors import InputError, WorkError, describe

app = typer.Typer(
    name="selfmodel",
    help="Find out what changed in a legged robot from a few logged trials, and get it walking.",
    no_args_is_help=True,
    add_completion=False,
    # An error that nobody foresaw shows its plain traceback: it is a bug report.
    pretty_exceptions_enable=False,
)
app.command()(robots)
app.command()(recover)
app.command()(trial)
app.command()(calibrate)
app.command()(diagnose)
app.command()(replay)
app.command()(render)
app.command()(ablate)
app.add_typer(suite.app)
app.add_typer(logs.app)


def main() -> None:
    """Runs the command line; exits with 0 done, 1 the work failed, 2 wrong usage or bad input."""
    try:
        app()
    except InputError as error:
        _fail(describe(error), 2)
    except (OSError, WorkError) as error:
        # A disk that is full, a folder that may not be written: the file's name is in it.
        _fail(describe(error), 1)
    except MemoryError as error:
        _fail(f"there is not enough memory ({error or 'for this'}): ask for less at once", 1)
    except KeyboardInterrupt:
        _fail("interrupted", 130)


def _fail(message: str, status: int) -> None:
    typer.echo(f"error: {plain(message)}", err=True)
    sys.exit(status)
