"""What commands that run a grid share: how they are interrupted, and how they end."""

from collections.abc import Callable, Sequence
from pathlib import Path

import typer

from selfmodel.cli.output.grid_display import Watch, grid_display
from selfmodel.experiments.grid import PartEnds


def run_shown(run: Callable[[Watch], Sequence[PartEnds]], out: Path) -> Sequence[PartEnds]:
    """Runs a grid and shows how far it has come; returns what failed.

    Ctrl-C ends the command with status 130, and a line that says how it goes on.

    Args:
        run: Runs it, and tells what it is given of every event.
        out: Its folder.
    """
    with grid_display() as on_event:
        try:
            return run(on_event)
        except KeyboardInterrupt:
            typer.echo(
                f"interrupted: {on_event.done} of {on_event.total} are done and kept in {out}; the "
                f"same command goes on with the rest",
                err=True,
            )
            raise typer.Exit(130) from None


def as_objects(failed: Sequence[PartEnds]) -> list[dict[str, str | None]]:
    """Returns what failed as JSON has it."""
    return [{"run": one.key, "part": one.part, "error": one.error} for one in failed]


def end(failed: Sequence[PartEnds]) -> None:
    """Ends the command with status 1 and a line, if anything failed."""
    if failed:
        typer.echo(
            f"{len(failed)} failed, the first of them {failed[0].key} {failed[0].part}: "
            f"{failed[0].error}; the same command tries them again",
            err=True,
        )
        raise typer.Exit(1)
