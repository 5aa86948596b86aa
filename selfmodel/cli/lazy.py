"""Command groups that import a command's module when the command runs, so that help is fast."""

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command

from selfmodel.cli.help_page import HelpPageCommand


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
        try:
            return super().make_context(*args, **extra)
        except KeyboardInterrupt as interruption:
            raise Interrupted(interruption) from interruption

    def invoke(self, ctx: Any) -> Any:  # noqa: ANN401  # as typer declares it
        """Runs a command."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt as interruption:
            raise Interrupted(interruption) from interruption


class LazyCommand(TyperCommand):
    """Name and one-line help of a command; its callback imports and returns the command."""

    def make_context(self, *args: Any, **extra: Any) -> Any:  # noqa: ANN401  # as typer declares it
        """Imports the command and parses its arguments."""
        if self.callback is None:
            raise TypeError(f"the command {self.name} needs a callback that imports it")
        return self.callback().make_context(*args, **extra)


def group(
    name: str, summary: str, commands: Mapping[str, tuple[str, str]], *, completion: bool = False
) -> typer.Typer:
    """Returns a command group.

    Args:
        name: Name of the group.
        summary: Help text of the group.
        commands: ``module:function`` and one-line help per command, in the order of the help page.
        completion: Adds the options that install shell completion.
    """
    app = _app(
        cls=InterruptibleGroup,
        name=name,
        help=summary,
        no_args_is_help=True,
        add_completion=completion,
    )
    for command, (target, text) in commands.items():
        app.command(command, help=text, cls=LazyCommand)(_importer(command, target))
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


def _importer(name: str, target: str) -> Callable[[], Any]:
    """Returns a function that imports ``module:function`` or ``module:group`` as a command."""

    def imported() -> Any:  # noqa: ANN401  # typer hides the type
        module, _, attribute = target.partition(":")
        found = getattr(import_module(module), attribute)
        if isinstance(found, typer.Typer):
            return get_command(found)
        alone = _app(add_completion=False)
        alone.command(name, cls=HelpPageCommand)(found)
        return get_command(alone)

    return imported
