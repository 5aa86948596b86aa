"""The command line: one file a command, imported when the command runs."""

import sys
from importlib.metadata import version
from typing import Annotated, Any

import typer

from selfmodel.cli.lazy import Interrupted, group
from selfmodel.cli.output.library_warnings import counted_warnings
from selfmodel.cli.output.plain import plain
from selfmodel.cli.output.printing import print_lines, print_notes
from selfmodel.cli.output.streams import flush_output, open_streams
from selfmodel.errors import InputError, WorkError, describe
from selfmodel.physical.stop_signals import handle_stop_signals, status_of

COMMANDS = {
    "robots": (
        "selfmodel.cli.commands:Robots",
        "selfmodel.cli.robots:robots",
        "List the robots, or the parts of one.",
    ),
    "recover": (
        "selfmodel.cli.commands:Recover",
        "selfmodel.cli.recover:recover",
        "Diagnose a failure and evolve a new gait.",
    ),
    "trial": (
        "selfmodel.cli.commands:RunTrial",
        "selfmodel.cli.trial:trial",
        "Run and log one trial of the simulated robot.",
    ),
    "calibrate": (
        "selfmodel.cli.commands:Calibrate",
        "selfmodel.cli.calibrate:calibrate",
        "Fit the self-model to logged trials.",
    ),
    "diagnose": (
        "selfmodel.cli.commands:Diagnose",
        "selfmodel.cli.diagnose:diagnose",
        "Rank the hypotheses that explain logs.",
    ),
    "replay": (
        "selfmodel.cli.commands:ReplayTrial",
        "selfmodel.cli.replay:replay",
        "Simulate a logged trial again, and compare.",
    ),
    "render": (
        "selfmodel.cli.commands:Render",
        "selfmodel.cli.render:render",
        "Draw a logged trial beside its simulation.",
    ),
    "view": (
        "selfmodel.cli.commands:View",
        "selfmodel.cli.view:view",
        "Open a logged trial and its simulation in Rerun.",
    ),
    "report": (
        "selfmodel.cli.commands:MakeReport",
        "selfmodel.cli.report:report",
        "Write a run, logs or a campaign as one HTML page.",
    ),
    "ablate": (
        "selfmodel.cli.study_commands:Ablate",
        "selfmodel.cli.studies:ablate",
        "Compare comparators on the same trials.",
    ),
    "suite": ("selfmodel.cli.groups:suite", "", "Recover the bodies of dm_control's suite."),
    "paper": (
        "selfmodel.cli.study_commands:RepeatPaper",
        "selfmodel.cli.studies:paper",
        "Repeat the paper's experiment on its robots.",
    ),
    "compare": (
        "selfmodel.cli.study_commands:Compare",
        "selfmodel.cli.compare:compare",
        "Compare the methods of a study by pairs.",
    ),
    "repertoire": ("selfmodel.cli.groups:repertoire", "", "Make a repertoire of a robot's gaits."),
    "logs": ("selfmodel.cli.groups:logs", "", "Inspect, verify, salvage and import trial logs."),
}
"""Options, work and one-line help per command; see ``group``."""

app = group(
    "selfmodel",
    "Diagnose what changed in a legged robot from a few logged trials, and recover its gait.",
    COMMANDS,
    completion=True,
)


def _print_version(wanted: bool) -> None:  # noqa: FBT001  # typer passes the value by position
    if wanted:
        print_lines(f"selfmodel {version('selfmodel')}")
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


UsageError: Any = typer.BadParameter.__base__
"""Error of unknown commands, options and values; typer has no public name for it."""


def main() -> None:
    """Runs the command line.

    Exit status: 0 done; 1 the work failed; 2 wrong usage or bad input; 130, 143 or 129 after
    SIGINT, SIGTERM or SIGHUP.
    """
    open_streams()
    with handle_stop_signals():
        try:
            _run()
        except InputError as error:
            _fail(describe(error), 2)
        except BrokenPipeError:
            sys.exit(1)  # the reader has read enough
        except (OSError, WorkError) as error:
            # A full disk, a folder without write permission: the message contains the file's name.
            _fail(describe(error), 1)
        except MemoryError as error:
            _fail(
                f"there is not enough memory ({str(error) or 'for this'}): request less at once", 1
            )
        except KeyboardInterrupt as interruption:
            notes = "; ".join(getattr(interruption, "__notes__", ()))
            _fail(f"interrupted: {notes}" if notes else "interrupted", status_of(interruption))


def _run() -> None:
    try:
        with counted_warnings():
            # The same usage line for `python -m selfmodel` as for the installed command.
            status = app(prog_name="selfmodel", standalone_mode=False)
    except Interrupted as end:
        raise end.interruption from None
    except UsageError as error:
        status = _print_usage(error)
    finally:
        flush_output()
    sys.exit(status or 0)


def _print_usage(error: Any) -> int:  # noqa: ANN401  # typer hides the type
    """Prints a usage error with the usage line, and returns the exit status."""
    # Without arguments, the message is the help page: lines of ours.
    if error.ctx is None or error.message != error.ctx.get_help():
        error.message = plain(error.message)
    error.show()
    return int(error.exit_code)


def _fail(message: str, status: int) -> None:
    print_notes(f"error: {message}")
    sys.exit(status or 0)
