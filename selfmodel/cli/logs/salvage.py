"""``selfmodel logs salvage``: the complete data of a damaged log in a new log."""

import dataclasses
from pathlib import Path
from typing import Annotated

import typer

from selfmodel.cli.arguments.inputs import check_log_name
from selfmodel.cli.arguments.options import Json, NewLog
from selfmodel.cli.output.plain import counted
from selfmodel.cli.output.printing import print_json, print_lines
from selfmodel.logs.mcap.provenance import UNTIED
from selfmodel.logs.salvage import Discarded, salvage as save


def salvage(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Damaged log, or NAME.mcap.part.")],
    *,
    out: NewLog,
    as_json: Json = False,
) -> None:
    """Save all complete data of a truncated or damaged log in a new, valid one."""
    check_log_name(out)
    saved = save(file, out)
    if as_json:
        print_json({"source": str(file), **dataclasses.asdict(saved)}, indent=None)
        return
    print_lines(f"saved {saved.steps} of {counted(saved.planned, 'step')} in {saved.log}")
    if saved.span > saved.steps:
        print_lines(
            f"it spans {counted(saved.span, 'step')}; lost data of the others is marked as not "
            f"observed"
        )
    for topic, count in saved.missing.items():
        print_lines(f"{topic}: {counted(count, 'message')} lost")
    for name in saved.lost:
        print_lines(f"{name} is lost: {_CONSEQUENCES.get(name, _OTHERWISE)}")
    print_lines(*map(_left_out, saved.discarded))
    if not saved.tied:
        print_lines(
            f"not tied to its trial: {UNTIED}; if this file is a mixture of two trials, so is the "
            f"new log"
        )


def _left_out(other: Discarded) -> str:
    if not other.trial:
        return f"left out: {counted(other.steps, 'step')} without a seal"
    return (
        f"left out: {counted(other.steps, 'step')} in {counted(other.batches, 'batch')} sealed for "
        f"the trial {other.trial} ({other.identity[:12]})"
    )


_CONSEQUENCES = {
    "controller.npz": "the logged commands are played back instead",
    "/robot_description": "viewers do not draw the robot",
    "settings.json": "the paper's settings are used instead",
}
_OTHERWISE = "the new log does not contain it"
