"""Command groups that import a command as it runs, and its help page, so that help is fast."""

import dataclasses
import textwrap
import tomllib
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from importlib import import_module, resources
from inspect import Parameter, Signature
from typing import Annotated, Any, get_type_hints

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command

ARGUMENTS, OTHERS = "Arguments", "Options"
"""Headings of the first and the last group on a page, and sections of ``options.toml``."""


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
            if (record := param.get_help_record(ctx)) is not None:
                heading = getattr(param, "rich_help_panel", None)
                heading = ARGUMENTS if param.param_type_name == "argument" else heading
                rows = groups.setdefault(heading, []) if heading else others
                rows.append((_names(param), record[1]))
        groups[OTHERS] = others
        # The same first column in every group.
        column = 4 + max(len(names) for rows in groups.values() for names, _ in rows)
        for heading, rows in filter(lambda group: group[1], groups.items()):
            with formatter.section(heading):
                for names, text in rows:
                    formatter.write(_row(f"  {names}".ljust(column), text, formatter.width))


def _row(names: str, text: str, width: int) -> str:
    """Returns the lines of an option; names with hyphens, such as comparators', stay whole."""
    wrapper = textwrap.TextWrapper(width, names, " " * len(names), break_on_hyphens=False)
    return f"{wrapper.fill(text)}\n"


def _names(param: Any) -> str:  # noqa: ANN401  # the same
    if param.param_type_name == "argument":
        return str(param.metavar)
    short = [name for name in param.opts if not name.startswith("--")]
    names = ", ".join([*short, next(name for name in param.opts if name.startswith("--"))])
    if param.secondary_opts:
        return f"{names}/{param.secondary_opts[0]}"
    return names if param.is_flag else f"{names} {param.metavar}"


def group(
    name: str,
    summary: str,
    commands: Mapping[str, tuple[str, str, str] | tuple[str, typer.Typer]],
    *,
    completion: bool = False,
) -> typer.Typer:
    """Returns a command group, with or without the options that install shell completion.

    The commands are in the order of the help page. Each has its one-line help; ``module:function``
    of its work, which is imported as the command runs; and the class in ``commands`` of the options
    that the work takes. A group has its application instead of the last two.
    """
    app = _app(name=name, help=summary, no_args_is_help=True, add_completion=completion)
    for command, (text, *source) in commands.items():
        app.command(command, help=text, cls=LazyCommand)(_importer(command, *source))
    return app


def _app(**settings: Any) -> typer.Typer:  # noqa: ANN401  # of several types
    return typer.Typer(
        cls=TyperGroup,
        context_settings={"help_option_names": ["-h", "--help"]},
        # An unforeseen error prints its traceback: it is a bug report.
        pretty_exceptions_enable=False,
        # Plain help pages: no frames, and no import of rich.
        rich_markup_mode=None,
        **settings,
    )


def _importer(name: str, work: Any, options: str = "") -> Callable[[], Any]:  # noqa: ANN401
    """Returns a function that returns the command with this work and these options, or a group."""

    @cache
    def imported() -> Any:  # noqa: ANN401  # typer hides the type
        if isinstance(work, typer.Typer):
            return get_command(work)
        taken = getattr(import_module("selfmodel.cli.commands"), options)

        def run(**given: Any) -> None:  # noqa: ANN401  # as the fields are
            module, _, function = work.partition(":")
            getattr(import_module(f"selfmodel.cli.{module}"), function)(taken(**given))

        # What typer reads of a function.
        run.__doc__ = taken.__doc__
        parameters = parameters_of(taken)
        run.__annotations__ = {one.name: one.annotation for one in parameters}
        vars(run)["__signature__"] = Signature(parameters)
        alone = _app(add_completion=False)
        alone.command(name, cls=HelpPageCommand)(run)
        return get_command(alone)

    return imported


def parameters_of(command: type) -> list[Parameter]:
    """Returns the fields of a command's dataclass as parameters with typer's options.

    An option is that of ``CLASS.FIELD`` in ``options.toml``, for the command or a class it inherits
    from, or else of ``FIELD``; the order is that of the file, but for the command's ``PANELS``.
    """
    annotated: Any = Annotated  # with types of run time
    table, hints = options(), get_type_hints(command)
    panels = {name: place for place, name in enumerate(getattr(command, "PANELS", ()))}
    found = {}
    for field in dataclasses.fields(command):
        names = [f"{one.__name__}.{field.name}" for one in command.__mro__] + [field.name]
        name = next(name for name in names if name in table)
        panel, option = table[name]
        default = Parameter.empty if field.default is dataclasses.MISSING else field.default
        typed = annotated[hints[field.name], option]
        parameter = Parameter(field.name, Parameter.KEYWORD_ONLY, default=default, annotation=typed)
        found[panels.get(panel, len(panels)), list(table).index(name)] = parameter
    return [found[place] for place in sorted(found)]


@cache
def options() -> dict[str, tuple[str, Any]]:
    """Returns the heading and typer's declaration of each option, in the order of a help page."""
    text = resources.files(__package__).joinpath("options.toml").read_text(encoding="utf-8")
    return {
        name: (heading, _declaration(heading, **facts))
        for heading, section in tomllib.loads(text).items()
        for name, facts in section.items()
    }


def _declaration(heading: str, names: Sequence[str] = (), **facts: Any) -> Any:  # noqa: ANN401
    if heading == ARGUMENTS:
        return typer.Argument(**facts)
    panel = None if heading == OTHERS else heading
    return typer.Option(*names, rich_help_panel=panel, **facts)
