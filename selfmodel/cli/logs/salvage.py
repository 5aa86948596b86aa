"""``selfmodel logs salvage``: the complete data of a damaged log in a new log."""

import dataclasses
import json
from pathlib import Path
from typing import Annotated

import typer

from selfmodel.cli.inputs import check_log_name
from selfmodel.cli.options import DEFAULT_BUDGET, FileBudget, Json, NewLog
from selfmodel.cli.output.plain import counted
from selfmodel.logs.salvage import salvage as save
from selfmodel.sandbox.budget import Budget


def salvage(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Damaged log, or NAME.mcap.part.")],
    *,
    out: NewLog,
    budget: FileBudget = DEFAULT_BUDGET,
    as_json: Json = False,
) -> None:
    """Save all complete data of a truncated or damaged log in a new, valid one."""
    check_log_name(out)
    saved = save(file, out, Budget.parse(budget))
    if as_json:
        typer.echo(json.dumps({"source": str(file), **dataclasses.asdict(saved)}))
        return
    typer.echo(f"saved {saved.steps} of {counted(saved.planned, 'step')} in {saved.log}")
    if saved.span > saved.steps:
        typer.echo(
            f"it spans {counted(saved.span, 'step')}; lost data of the others is marked as not "
            f"observed"
        )
    for topic, count in saved.missing.items():
        typer.echo(f"{topic}: {counted(count, 'message')} lost")
    for name in saved.lost:
        typer.echo(f"{name} is lost: {_CONSEQUENCES[name]}")


_CONSEQUENCES = {
    "controller.npz": "the logged commands are played back instead",
    "/robot_description": "viewers do not draw the robot",
    "settings.json": "the paper's settings are used instead",
}
