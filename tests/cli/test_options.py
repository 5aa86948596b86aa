"""The options of the command line: defaults of the library, lists with commas, shares."""

import dataclasses
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, strategies as st
from typer.testing import CliRunner

from selfmodel import api, plugins, recording
from selfmodel.cli import app, commands, inputs
from selfmodel.cli.groups import options, parameters_of
from selfmodel.errors import InputError
from selfmodel.recovery.map_elites import make_repertoire
from selfmodel.settings import Settings
from selfmodel.studies import plans
from tests.helpers.command import selfmodel

COMMANDS = [
    one
    for one in vars(commands).values()
    if isinstance(one, type) and issubclass(one, commands.Command)
]


PARSERS: dict[str, Callable[[str], object]] = {
    "kinds": plugins.kinds,
    "only": plans.share_of,
    "gaps": float,
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
        (commands.RunTrial, recording.run_trial, {}),
        (commands.RunTrial, recording.simulated_robot, {}),
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


@pytest.mark.parametrize(
    ("option", "value", "sentence"),
    [
        ("--robots", "quadrupde", "unknown robot 'quadrupde': did you mean quadruped?"),
        ("--robots", "quadruped,,hexapod", "--robots needs a list with commas"),
        ("--case", "1,11", "unknown case of quadruped '11'"),
        ("--case", "1,two", "--case needs whole numbers"),
        ("--comparator", "forward-displacment", "did you mean forward-displacement?"),
        ("--gap", "0,big", "--gap needs numbers with commas between them"),
        ("--gap", "-0.1", "expected a gap from 0 to 0.5, such as 0.05, got -0.1"),
        ("--gap", "nan", "expected a gap from 0 to 0.5"),
        ("--gaps", "5", "expected a gap from 0 to 0.5"),
        ("--trials", "7", "the same gait gives the same trial, and the bank has 6"),
        ("--next-trial", "repairs", "did you mean repair?"),
        ("--only", "3/2", "--only needs i/n"),
        ("--only", "0/2", "--only needs i/n"),
        ("--executor", "slrum", "unknown executor 'slrum'"),
        ("--only", "1/" + "9" * 5000, "--only needs i/n"),
        ("--damage", "break:nose", "unknown part in the term 'break:nose'"),
        ("--damages", "brek:front_left_knee", "did you mean break?"),
        (
            "--kinds",
            "selfmodel.faults.sensors:SILENT_NEURON",
            "no diagnosis may propose neuron: leave neuron out",
        ),
        (
            "--kinds",
            "break,frction",
            "unknown kind 'frction': did you mean friction, joint-friction?",
        ),
        (
            "--case",
            " none ",
            "expected at least one case or one damage of a study, got neither",
        ),
    ],
)
def test_a_bad_list_is_refused_in_a_sentence_before_anything_is_run(
    tmp_path: Path, option: str, value: str, sentence: str
):
    out = tmp_path / "out"
    arguments = ["ablate", "--robots", "quadruped", option, value, "--out", str(out)]
    told = CliRunner().invoke(app, arguments)

    assert isinstance(told.exception, InputError)
    assert sentence in str(told.exception)
    assert not out.exists()


@given(st.lists(st.text("abc:._", min_size=1), min_size=1))
def test_a_list_is_what_stands_between_the_commas_each_once(items: list[str]):
    assert inputs.texts("--any", " , ".join(items)) == tuple(dict.fromkeys(items))


def test_a_number_is_one_number_however_it_is_written():
    assert inputs.whole_numbers("--any", "2,02,1,+2", ()) == (2, 1)


def test_an_error_repeats_no_name_of_any_length(tmp_path: Path):
    (tmp_path / "long.xml").write_text(f'<mujoco><include file="{"n" * 100_000}"/></mujoco>')
    done = selfmodel("trial", "long.xml", "--out", "a.mcap", cwd=tmp_path)

    assert done.returncode == 2
    assert 20_000 < len(done.stderr) < 30_000
