"""Directive ``command-line``: the help of every command, from the Typer application itself."""

import inspect
from collections.abc import Iterator

import click
import typer.main
from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from sphinx.util.typing import ExtensionMetadata

from selfmodel.cli import app


class CommandLine(SphinxDirective):
    """Lists each command with its help text, arguments and options."""

    def run(self) -> list[nodes.Node]:
        """Returns a section per command."""
        command = typer.main.get_command(app)
        lines = list(_lines(command, click.Context(command, info_name="selfmodel")))
        return self.parse_content_to_nodes_with(lines)

    def parse_content_to_nodes_with(self, lines: list[str]) -> list[nodes.Node]:
        """Parses generated Markdown, headings included."""
        content = StringList(lines, source="selfmodel --help")
        return self.parse_text_to_nodes("\n".join(content), allow_section_headings=True)


def _lines(command: click.Command, context: click.Context) -> Iterator[str]:
    if isinstance(command, click.Group):
        for name in command.list_commands(context):
            child = command.get_command(context, name)
            if child is not None and not child.hidden:
                yield from _lines(child, click.Context(child, info_name=name, parent=context))
        return
    path = context.command_path
    yield from (f"## {path}", "", inspect.cleandoc(command.help or ""), "")
    usage = " ".join(command.collect_usage_pieces(context))
    yield from ("```text", f"{path} {usage}", "```", "")
    for parameter in command.get_params(context):
        if not getattr(parameter, "hidden", False):
            yield from _parameter(parameter, context)


def _parameter(parameter: click.Parameter, context: click.Context) -> Iterator[str]:
    metavar = parameter.make_metavar(context)
    if isinstance(parameter, click.Argument):
        title, text = f"`{metavar}`", getattr(parameter, "help", None)
    else:
        names = ", ".join([*parameter.opts, *parameter.secondary_opts])
        flag = getattr(parameter, "is_flag", False)
        title = f"`{names}`" if flag else f"`{names} {metavar}`"
        text = getattr(parameter, "help", None)
    yield title
    yield f": {' '.join((text or '').split())}{_default(parameter)}"
    yield ""


def _default(parameter: click.Parameter) -> str:
    if parameter.required:
        return " *Required.*"
    shown = getattr(parameter, "show_default", None)
    if isinstance(shown, str):
        return f" Default: {shown}."
    if shown and parameter.default not in (None, False, ()) and not callable(parameter.default):
        return f" Default: `{parameter.default}`."
    return ""


def setup(sphinx: Sphinx) -> ExtensionMetadata:
    """Registers the directive."""
    sphinx.add_directive("command-line", CommandLine)
    return {"parallel_read_safe": True}
