"""The layout for Foxglove and Lichtblick that is installed with the package."""

from importlib.resources import as_file, files
from pathlib import Path


def layout_path() -> Path:
    """Returns the path of the installed layout."""
    with as_file(files("selfmodel.cli.logs") / "foxglove-layout.json") as path:
        return path


def foxglove_lines(log: str) -> tuple[str, ...]:
    """Returns how to open a log in Foxglove, one sentence per line.

    Args:
        log: The log as the user named it.
    """
    layout = layout_path()
    return (
        f"In Foxglove or Lichtblick: open the local file {log}, then import the layout {layout}.",
        "The layout's plots of legs are of the quadruped: other robots need their own indices.",
    )
