"""The options of the command line: their defaults are those of the library."""

import dataclasses
import inspect
from collections.abc import Callable
from typing import Any

import pytest

from selfmodel import api, plugins
from selfmodel.cli import commands, inputs
from selfmodel.cli.groups import options, parameters_of
from selfmodel.recovery.map_elites import make_repertoire
from selfmodel.settings import Settings
from selfmodel.studies import plans

COMMANDS = [
    one
    for one in vars(commands).values()
    if isinstance(one, type) and issubclass(one, commands.Command)
]


PARSERS: dict[str, Callable[[str], object]] = {
    "kinds": plugins.kinds,
    "only": lambda text: inputs.share("--only", text),
    "next_trial": lambda text: plugins.NEXT_TRIAL.get(text, text),
}
"""What makes the library's values of options that are texts."""


def defaults(target: Callable[..., object]) -> dict[str, Any]:
    """The defaults of the parameters of a function, or of the fields of a dataclass."""
    parameters = inspect.signature(target).parameters.values()
    return {one.name: one.default for one in parameters if one.default is not one.empty}


@pytest.mark.parametrize(
    ("command", "target", "names"),
    [
        (commands.Recover, api.recover, {"controller": "design"}),
        (commands.Diagnose, api.diagnose, {}),
        (commands.Calibrate, api.calibrate, {}),
        (commands.ReplayTrial, api.replay, {}),
        (commands.RunTrial, api.run_trial, {}),
        (commands.RunTrial, api.simulated_robot, {}),
        (commands.Study, Settings, {}),
        (commands.Ablate, plans.ablation, {}),
        (commands.RunSuite, plans.suite, {}),
        (commands.RepeatPaper, plans.paper, {}),
        (commands.MakeRepertoire, make_repertoire, {}),
    ],
)
def test_a_default_of_a_command_is_that_of_the_library(
    command: type, target: Callable[..., object], names: dict[str, str]
):
    given, taken = defaults(command), defaults(target)
    for name, value in given.items():
        expected = taken.get(names.get(name, name))
        if expected is not None and name in PARSERS:
            parse = PARSERS[name]
            made = parse(expected) if isinstance(expected, str) else expected
            assert parse(value) == made, name
        elif isinstance(expected, bool | int | float | str) and value is not None:
            assert value == expected, name


def test_every_option_of_the_table_is_of_a_command():
    used = {(one.__name__, field.name) for one in COMMANDS for field in dataclasses.fields(one)}
    names = {name for pair in used for name in (pair[1], ".".join(pair))}

    assert set(options()) <= names
    assert all(map(parameters_of, COMMANDS))
