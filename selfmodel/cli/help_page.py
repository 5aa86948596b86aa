"""Help pages of commands: options in named groups, in two columns that fit 80 characters."""

import textwrap
from typing import Any

from typer.core import TyperCommand

ARGUMENTS, OTHERS = "Arguments", "Options"
"""Headings of the first and the last group on a page."""


class HelpPageCommand(TyperCommand):
    """A command whose help page groups the options by their ``rich_help_panel``."""

    def collect_usage_pieces(self, ctx: Any) -> list[str]:  # noqa: ANN401  # typer hides the type
        """Returns the words after the command's name in the usage line."""
        arguments = [one for one in self.get_params(ctx) if one.param_type_name == "argument"]
        return ["[OPTIONS]", *(str(one.metavar) for one in arguments)]

    def format_options(self, ctx: Any, formatter: Any) -> None:  # noqa: ANN401  # the same
        """Writes the arguments, each group of options, and the other options."""
        groups: dict[str, list[tuple[str, str]]] = {ARGUMENTS: []}
        others: list[tuple[str, str]] = []
        for param in self.get_params(ctx):
            record = param.get_help_record(ctx)
            if record is None:
                continue
            heading = getattr(param, "rich_help_panel", None)
            if param.param_type_name == "argument":
                groups[ARGUMENTS].append((str(param.metavar), record[1]))
            else:
                rows = groups.setdefault(heading, []) if heading else others
                rows.append((_names(param), record[1]))
        groups[OTHERS] = others
        # The same first column in every group.
        column = 4 + max(len(names) for rows in groups.values() for names, _ in rows)
        for heading, rows in groups.items():
            if rows:
                with formatter.section(heading):
                    for names, text in rows:
                        formatter.write(_row(f"  {names}".ljust(column), text, formatter.width))


def _row(names: str, text: str, width: int) -> str:
    """Returns the lines of an option; names with hyphens, such as comparators', stay whole."""
    lines = textwrap.fill(
        text,
        width,
        initial_indent=names,
        subsequent_indent=" " * len(names),
        break_on_hyphens=False,
    )
    return f"{lines}\n"


def _names(option: Any) -> str:  # noqa: ANN401  # the same
    """Returns the names that a help page shows: short ones, and the first of the long ones."""
    short = [name for name in option.opts if not name.startswith("--")]
    names = ", ".join([*short, next(name for name in option.opts if name.startswith("--"))])
    if option.secondary_opts:
        return f"{names}/{option.secondary_opts[0]}"
    return names if option.is_flag else f"{names} {option.metavar}"
