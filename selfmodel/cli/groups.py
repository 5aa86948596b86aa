"""Command groups that import a command as it runs, and its help page, so that help is fast."""

import textwrap
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command

ARGUMENTS, OTHERS = "Arguments", "Options"
"""Headings of the first and the last group on a page."""


class Interrupted(Exception):  # noqa: N818  # no error: the user ended the command
    """Interruption of a command; typer replaces a ``KeyboardInterrupt`` by an exit status.

    Args:
        interruption: The interruption.
    """

    def __init__(self, interruption: KeyboardInterrupt) -> None:
        super().__init__()
        self.interruption = interruption


class InterruptibleGroup(TyperGroup):
    """Command group whose commands end with ``Interrupted``."""

    def make_context(self, *args: Any, **extra: Any) -> Any:  # noqa: ANN401  # as typer declares it
        """Parses the arguments before the command."""
        with _interruptible():
            return super().make_context(*args, **extra)

    def invoke(self, ctx: Any) -> Any:  # noqa: ANN401  # as typer declares it
        """Runs a command."""
        with _interruptible():
            return super().invoke(ctx)


@contextmanager
def _interruptible() -> Iterator[None]:
    try:
        yield
    except KeyboardInterrupt as interruption:
        raise Interrupted(interruption) from interruption


class LazyCommand(TyperCommand):
    """Name and one-line help of a command; its callback imports and returns the command."""

    def make_context(self, *args: Any, **extra: Any) -> Any:  # noqa: ANN401  # as typer declares it
        """Imports the options of the command and parses its arguments."""
        return self.imported().make_context(*args, **extra)

    def imported(self) -> Any:  # noqa: ANN401  # typer hides the type
        """Returns the command."""
        return self.callback()  # type: ignore[misc]  # never None


class HelpPageCommand(TyperCommand):
    """A command whose help page has named groups of options, in two columns of 80 characters."""

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
    wrapper = textwrap.TextWrapper(width, names, " " * len(names), break_on_hyphens=False)
    return f"{wrapper.fill(text)}\n"


def _names(option: Any) -> str:  # noqa: ANN401  # the same
    """Returns the names that a help page shows: short ones, and the first of the long ones."""
    short = [name for name in option.opts if not name.startswith("--")]
    names = ", ".join([*short, next(name for name in option.opts if name.startswith("--"))])
    if option.secondary_opts:
        return f"{names}/{option.secondary_opts[0]}"
    return names if option.is_flag else f"{names} {option.metavar}"


def group(
    name: str,
    summary: str,
    commands: Mapping[str, tuple[str, str, str] | tuple[str, typer.Typer]],
    *,
    completion: bool = False,
) -> typer.Typer:
    """Returns a command group.

    Args:
        name: Name of the group.
        summary: Help text of the group.
        commands: In the order of the help page, per command: its one-line help; ``module:function``
            of its work, which is imported as the command runs; and the class in ``commands`` of the
            options that the work takes. A group has its application instead of the last two.
        completion: Adds the options that install shell completion.
    """
    app = _app(
        cls=InterruptibleGroup,
        name=name,
        help=summary,
        no_args_is_help=True,
        add_completion=completion,
    )
    for command, (text, *source) in commands.items():
        app.command(command, help=text, cls=LazyCommand)(_importer(command, *source))
    return app


def _app(**settings: Any) -> typer.Typer:  # noqa: ANN401  # of several types
    return typer.Typer(
        context_settings={"help_option_names": ["-h", "--help"]},
        # An unforeseen error prints its traceback: it is a bug report.
        pretty_exceptions_enable=False,
        # Plain help pages: no frames, and no import of rich.
        rich_markup_mode=None,
        **settings,
    )


def _importer(name: str, work: Any, options: str = "") -> Callable[[], Any]:  # noqa: ANN401
    """Returns a function that returns the command with this work and these options, or a group."""

    def imported() -> Any:  # noqa: ANN401  # typer hides the type
        if isinstance(work, typer.Typer):
            return get_command(work)
        taken = getattr(import_module("selfmodel.cli.commands"), options)

        def run(**given: Any) -> None:  # noqa: ANN401  # as the fields are
            module, _, function = work.partition(":")
            getattr(import_module(f"selfmodel.cli.{module}"), function)(taken(**given))

        # What typer reads of a function.
        run.__doc__ = taken.__doc__
        signature = import_module("selfmodel.cli.options").signature_of(taken)
        run.__annotations__ = {key: one.annotation for key, one in signature.parameters.items()}
        vars(run)["__signature__"] = signature
        alone = _app(add_completion=False)
        alone.command(name, cls=HelpPageCommand)(run)
        return get_command(alone)

    return imported
