"""``selfmodel logs salvage``: the steps of a damaged log in a new log."""

import dataclasses
from pathlib import Path
from typing import Annotated

import typer

from selfmodel.cli.arguments.inputs import check_log_name
from selfmodel.cli.arguments.options import Json, NewLog
from selfmodel.cli.output.plain import counted
from selfmodel.cli.output.printing import print_json, print_lines
from selfmodel.logs.salvage import salvage as save


def salvage(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Damaged log, or NAME.mcap.part.")],
    *,
    out: NewLog,
    as_json: Json = False,
) -> None:
    """Save the steps before the first damage of a log in a new, valid one."""
    check_log_name(out)
    saved = save(file, out)
    if as_json:
        print_json({"source": str(file), **dataclasses.asdict(saved)}, indent=None)
        return
    print_lines(
        f"saved {saved.steps} of {counted(saved.planned, 'step')} in {saved.log}",
        f"the first damage of {file}: {saved.damage}",
    )
