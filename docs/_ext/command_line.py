"""Directive ``command-line``: the help of every command, from the Typer application itself."""

import inspect
from collections.abc import Iterator
from typing import Any

import typer.main
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from sphinx.util.typing import ExtensionMetadata
from typer.core import TyperGroup

from selfmodel.cli import app
from selfmodel.cli.groups import LazyCommand


class CommandLine(SphinxDirective):
    """Lists each command with its help text, arguments and options."""

    def run(self) -> list[nodes.Node]:
        """Returns a section per command."""
        command = typer.main.get_command(app)
        lines = _lines(command, typer.Context(command, info_name="selfmodel"))
        return self.parse_text_to_nodes("\n".join(lines), allow_section_headings=True)


def _lines(command: Any, context: typer.Context) -> Iterator[str]:  # noqa: ANN401  # no public type
    if isinstance(command, TyperGroup):
        for name in command.list_commands(context):
            child = command.get_command(context, name)
            if isinstance(child, LazyCommand):
                child = child.imported()
                yield from _lines(child, typer.Context(child, info_name=name, parent=context))
        return
    path = context.command_path
    yield from (f"## {path}", "", inspect.cleandoc(command.help or ""), "")
    usage = " ".join(command.collect_usage_pieces(context))
    yield from ("```text", f"{path} {usage}", "```", "")
    for parameter in command.get_params(context):
        record = parameter.get_help_record(context)
        if record is not None:
            yield from (f"`{record[0]}`", f": {' '.join(record[1].split())}", "")


def setup(sphinx: Sphinx) -> ExtensionMetadata:
    """Registers the directive."""
    sphinx.add_directive("command-line", CommandLine)
    return {"parallel_read_safe": True}
