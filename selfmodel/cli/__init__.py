"""The command line: one file a command, imported when the command runs."""

import os
import sys
from importlib.metadata import version
from typing import Annotated, Any

import typer
from typer.main import get_command

from selfmodel.cli.groups import group
from selfmodel.cli.output import (
    counted_warnings,
    flush_output,
    open_streams,
    plain,
    print_lines,
    print_notes,
)
from selfmodel.errors import InputError, WorkError, describe
from selfmodel.physical.safety import handle_stop_signals, status_of

SUITE = group(
    "suite",
    "Fail and recover the bodies of dm_control's suite, selfmodel's robots and your own.",
    {
        "list": ("List the domains and their cases.", "robots:list_bodies", "ListSuite"),
        "run": ("Run a study: bodies x cases x seeds.", "studies:run_suite", "RunSuite"),
        "evolve": ("Evolve a policy for a task.", "training:evolve", "EvolvePolicy"),
    },
)
REPERTOIRE = group(
    "repertoire",
    "Make a repertoire of diverse gaits of a robot, once, before it fails.",
    {
        "make": ("Search for diverse gaits, and keep them.", "repertoire:make", "MakeRepertoire"),
        "info": ("Show what a repertoire contains.", "repertoire:info", "RepertoireInfo"),
    },
)
LOGS = group(
    "logs",
    "Inspect and verify trial logs, salvage damaged ones, import recordings, export tables.",
    {
        "info": ("Show what logs contain.", "logs:info", "LogInfo"),
        "verify": ("Check every checksum, count and digest.", "logs:verify", "Verify"),
        "salvage": ("Save the good steps of a bad log.", "logs:salvage", "SalvageLog"),
        "import": ("Import a recording as a log.", "recordings:import_", "ImportRecording"),
        "export": ("Write a log's signals as a table.", "recordings:export", "ExportTable"),
    },
)
app = group(
    "selfmodel",
    "Diagnose what changed in a legged robot from a few logged trials, and recover its gait.",
    {
        "robots": ("List the robots, or the parts of one.", "robots:robots", "Robots"),
        "recover": ("Diagnose a failure and evolve a new gait.", "recover:recover", "Recover"),
        "trial": ("Run and log one trial of the simulated robot.", "trial:trial", "RunTrial"),
        "calibrate": ("Fit the self-model to logged trials.", "calibrate:calibrate", "Calibrate"),
        "diagnose": ("Rank the hypotheses that explain logs.", "diagnose:diagnose", "Diagnose"),
        "watch": ("Watch a robot through its log as it grows.", "watch:watch", "WatchLog"),
        "replay": ("Simulate a logged trial again, and compare.", "replay:replay", "ReplayTrial"),
        "render": ("Draw a logged trial beside its simulation.", "render:render", "Render"),
        "view": ("Open a logged trial and its simulation in Rerun.", "view:view", "View"),
        "report": (
            *("Write a run, logs or a campaign as one HTML page.", "report:report", "MakeReport"),
        ),
        "ablate": ("Compare comparators on the same trials.", "studies:ablate", "Ablate"),
        "suite": ("Recover the bodies of dm_control's suite.", SUITE),
        "paper": ("Repeat the paper's experiment on its robots.", "studies:paper", "RepeatPaper"),
        "study": ("Run the study that a TOML file defines.", "studies:run_file", "RunStudy"),
        "compare": ("Compare the methods of a study by pairs.", "compare:compare", "Compare"),
        "check": ("Check a plug-in of your own.", "check:check", "Check"),
        "repertoire": ("Make a repertoire of a robot's gaits.", REPERTOIRE),
        "logs": ("Inspect, verify, salvage and import trial logs.", LOGS),
    },
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


LONGEST_ERROR = 20_000
"""Longest error that is printed, characters: some repeat a name from a file."""

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
            sys.exit(_run())
        except InputError as error:
            _fail(describe(error), 2)
        except BrokenPipeError:
            sys.exit(1)  # the reader has read enough
        except (OSError, WorkError) as error:
            # A full disk, a folder without write permission: the message contains the file's name.
            _fail(describe(error), 1)
        except MemoryError as error:
            reason = str(error) or "for this"
            _fail(f"there is not enough memory ({reason}): request less at once", 1)
        except KeyboardInterrupt as interruption:
            notes = "; ".join(getattr(interruption, "__notes__", ()))
            _fail(f"interrupted: {notes}" if notes else "interrupted", status_of(interruption))


def _run() -> int:
    try:
        with counted_warnings():
            if "_SELFMODEL_COMPLETE" in os.environ:
                app(prog_name="selfmodel")
            # As typer's own main, which replaces a KeyboardInterrupt by an exit status.
            with get_command(app).make_context("selfmodel", sys.argv[1:]) as context:
                context.command.invoke(context)
    except typer.Exit as end:
        return end.exit_code
    except UsageError as error:
        # Without arguments, the message is the help page: lines of ours.
        if error.ctx is None or error.message != error.ctx.get_help():
            error.message = plain(error.message)
        error.show()
        return int(error.exit_code)
    finally:
        flush_output()
    return 0


def _fail(message: str, status: int) -> None:
    cut = f"{message[:LONGEST_ERROR]}..." if len(message) > LONGEST_ERROR else message
    print_notes(f"error: {cut}")
    sys.exit(status)
