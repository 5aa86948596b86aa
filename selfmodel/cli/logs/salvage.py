"""``selfmodel logs salvage``: saves what is complete of a damaged log."""

import dataclasses
import json
from pathlib import Path
from typing import Annotated

import typer

from selfmodel.cli.options import Json, check_log_name


def salvage(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A damaged log, or a .part.")],
    *,
    out: Annotated[
        Path,
        typer.Option("--out", "-o", metavar="OUT.mcap", help="The new log; it must not exist."),
    ],
    as_json: Json = False,
) -> None:
    """Save all complete data of a truncated or damaged log in a new, valid one."""
    from selfmodel.logs.salvage import salvage as save  # noqa: PLC0415  # with the other work

    check_log_name(out)
    saved = save(file, out)
    if as_json:
        typer.echo(json.dumps({"source": str(file), **dataclasses.asdict(saved)}))
        return
    typer.echo(f"saved {saved.steps} of {saved.planned} steps in {saved.log}")
    if saved.span > saved.steps:
        typer.echo(
            f"it spans {saved.span} steps; what is lost of the others is marked as not observed"
        )
    for topic, count in saved.missing.items():
        typer.echo(f"{topic}: {count} {'message is' if count == 1 else 'messages are'} lost")
    for name in saved.lost:
        typer.echo(f"{name} is lost: {_CONSEQUENCES[name]}")


_CONSEQUENCES = {
    "controller.npz": "the commands that were logged will be played back instead",
    "/robot_description": "viewers will not draw the robot",
    "settings.json": "the paper's numbers stand in its place",
}
