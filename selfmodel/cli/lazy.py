"""Command groups that import the work of a command when it runs, so that help is fast."""

from collections.abc import Callable, Mapping
from importlib import import_module
from inspect import signature
from typing import Any, get_type_hints

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
        """Imports the options of the command and parses its arguments."""
        if self.callback is None:
            raise TypeError(f"the command {self.name} needs a callback that imports it")
        return self.callback().make_context(*args, **extra)


def group(
    name: str,
    summary: str,
    commands: Mapping[str, tuple[str, str, str]],
    *,
    completion: bool = False,
) -> typer.Typer:
    """Returns a command group.

    Args:
        name: Name of the group.
        summary: Help text of the group.
        commands: In the order of the help page, per command: ``module:class`` of its options, a
            dataclass whose fields are typer's options; ``module:function`` of its work, which takes
            them, and is imported as the command runs; and its one-line help. A group has its
            ``module:app`` instead, and no work.
        completion: Adds the options that install shell completion.
    """
    app = _app(
        cls=InterruptibleGroup,
        name=name,
        help=summary,
        no_args_is_help=True,
        add_completion=completion,
    )
    for command, (options, work, text) in commands.items():
        app.command(command, help=text, cls=LazyCommand)(_importer(command, options, work))
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


def _importer(name: str, options: str, work: str) -> Callable[[], Any]:
    """Returns a function that returns the command with these options and this work, or a group."""

    def imported() -> Any:  # noqa: ANN401  # typer hides the type
        found = _attribute(options)
        if isinstance(found, typer.Typer):
            return get_command(found)

        def run(**given: Any) -> None:  # noqa: ANN401  # as the fields are
            _attribute(work)(found(**given))

        # What typer reads of a function.
        run.__doc__ = found.__doc__
        run.__annotations__ = get_type_hints(found, include_extras=True)
        vars(run)["__signature__"] = signature(found)
        alone = _app(add_completion=False)
        alone.command(name, cls=HelpPageCommand)(run)
        return get_command(alone)

    return imported


def _attribute(target: str) -> Any:  # noqa: ANN401  # of several types
    """Returns the object ``module:name``."""
    module, _, name = target.partition(":")
    return getattr(import_module(module), name)
