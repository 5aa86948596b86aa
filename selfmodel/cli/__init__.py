"""The command line: one file a command, imported when the command runs."""

import sys
from importlib.metadata import version
from typing import Annotated

import typer

from selfmodel.cli.lazy import group
from selfmodel.cli.output.library_warnings import counted_warnings
from selfmodel.cli.output.plain import plain
from selfmodel.errors import InputError, WorkError, describe

COMMANDS = {
    "robots": ("selfmodel.cli.robots:robots", "List the robots, or the parts of one."),
    "recover": ("selfmodel.cli.recover:recover", "Diagnose a failure and evolve a new gait."),
    "trial": ("selfmodel.cli.trial:trial", "Run and log one trial of the simulated robot."),
    "calibrate": ("selfmodel.cli.calibrate:calibrate", "Fit the self-model to logged trials."),
    "diagnose": ("selfmodel.cli.diagnose:diagnose", "Rank the hypotheses that explain logs."),
    "replay": ("selfmodel.cli.replay:replay", "Simulate a logged trial again, and compare."),
    "render": ("selfmodel.cli.render:render", "Draw a logged trial beside its simulation."),
    "ablate": ("selfmodel.cli.ablate:ablate", "Compare comparators on the same trials."),
    "suite": ("selfmodel.cli.suite:app", "Recover the bodies of dm_control's suite."),
    "logs": ("selfmodel.cli.logs:app", "Inspect, verify, salvage and import trial logs."),
}
"""``module:function`` and one-line help per command."""

app = group(
    "selfmodel",
    "Diagnose what changed in a legged robot from a few logged trials, and recover its gait.",
    COMMANDS,
    completion=True,
)


def _print_version(wanted: bool) -> None:  # noqa: FBT001  # typer passes the value by position
    if wanted:
        typer.echo(f"selfmodel {version('selfmodel')}")
        raise typer.Exit


@app.callback()
def selfmodel(
    *,
    _version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version and exit."
        ),
    ] = False,
) -> None:
    """Parses the options that come before the command."""


def main() -> None:
    """Runs the command line.

    Exit status: 0 done; 1 the work failed; 2 wrong usage or bad input; 130 interrupted.
    """
    try:
        with counted_warnings():
            # The same usage line for `python -m selfmodel` as for the installed command.
            app(prog_name="selfmodel")
    except InputError as error:
        _fail(describe(error), 2)
    except (OSError, WorkError) as error:
        # A full disk, a folder without write permission: the message contains the file's name.
        _fail(describe(error), 1)
    except MemoryError as error:
        _fail(f"there is not enough memory ({error or 'for this'}): request less at once", 1)
    except KeyboardInterrupt:
        _fail("interrupted", 130)


def _fail(message: str, status: int) -> None:
    typer.echo(f"error: {plain(message)}", err=True)
    sys.exit(status)
