"""Help pages: their width, their columns, and the options that they show."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
import typer

from selfmodel import __version__, cli
from selfmodel.cli.groups import options
from selfmodel.faults.registry import ALL_KINDS, KIND_SETS
from selfmodel.trials.trial import STAGES
from tests.helpers.command import selfmodel

GROUPS = {(): cli.app, ("logs",): cli.LOGS, ("suite",): cli.SUITE}
GROUPS[("repertoire",)] = cli.REPERTOIRE


def commands() -> Iterator[tuple[str, ...]]:
    """The words of every group and command."""
    for words, group in GROUPS.items():
        yield words
        for command in group.registered_commands:
            if (*words, command.name) not in GROUPS:
                yield (*words, str(command.name))


@pytest.fixture(params=commands(), ids=" ".join)
def page(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """Each help page in turn."""
    done = selfmodel(*request.param, "--help", cwd=tmp_path, COLUMNS="80")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith(" ".join(("Usage: selfmodel", *request.param, "")))
    return done.stdout


ROW = re.compile(r"  (-\S.*?|[A-Z[]\S*)  +(?=\S)")
"""The first column of an option or an argument."""


def test_a_help_page_fits_80_columns_and_leaves_40_for_the_descriptions(page: str):
    lines = page.splitlines()
    starts = {match.end() for line in lines if (match := ROW.match(line))}

    assert max(map(len, lines)) <= 80
    assert len(starts) == 1, "one first column on a page"
    assert 80 - max(starts) >= 40


def test_a_help_page_names_every_value_and_describes_every_option(page: str):
    blocks = [block for block in page.split("\n\n") if re.match(r"[A-Z][\w ]+:\n", block)]
    rows = [line for block in blocks for line in block.splitlines() if line.startswith("  -")]

    assert not re.search(r"<[a-z]", page), "a type in the place of a value's name"
    assert all(map(ROW.match, rows))
    assert re.fullmatch(r"  -h, --help +Show this message and exit.", rows[-1])


def test_help_names_every_kind_set_of_kinds_and_stage():
    """The page is text, so that it needs neither them nor numpy."""
    (_, kinds), (_, stage) = options()["kinds"], options()["stage"]
    named = ", ".join(kind.name for kind in ALL_KINDS)

    assert f": {named}, package.module:object; or their sets: {', '.join(KIND_SETS)}." in kinds.help
    assert f": {', '.join(STAGES)}." in stage.help


@pytest.mark.parametrize("group", GROUPS.values(), ids=lambda group: group.info.name)
def test_the_list_of_commands_has_a_line_each(group: typer.Typer, tmp_path: Path):
    words = next(words for words, app in GROUPS.items() if app is group)
    listed = selfmodel(*words, "-h", cwd=tmp_path, COLUMNS="80").stdout.partition("Commands:\n")[2]

    assert [line.split()[0] for line in listed.splitlines()] == [
        command.name for command in group.registered_commands
    ]
    assert all(line.endswith(".") and not line.endswith("...") for line in listed.splitlines())


def test_the_version_is_that_of_the_package(tmp_path: Path):
    assert selfmodel("--version", cwd=tmp_path).stdout == f"selfmodel {__version__}\n"


@pytest.mark.parametrize("words", [(), ("logs",), ("suite",)])
def test_a_group_without_a_command_prints_its_help(words: tuple[str, ...], tmp_path: Path):
    done = selfmodel(*words, cwd=tmp_path)

    assert done.returncode == 2
    assert "Commands:" in done.stdout + done.stderr


def test_a_mistyped_command_or_option_is_answered_with_the_nearest(tmp_path: Path):
    command = selfmodel("diagnos", cwd=tmp_path)
    option = selfmodel("diagnose", "a.mcap", "--comparater", "x", cwd=tmp_path)

    assert (command.returncode, option.returncode) == (2, 2)
    assert "Did you mean 'diagnose'" in command.stderr
    assert "--comparator" in option.stderr


def test_the_shell_completes_commands_and_options(tmp_path: Path):
    def completed(words: str) -> list[str]:
        environment = {"COMP_WORDS": words, "COMP_CWORD": "2"}
        done = selfmodel(cwd=tmp_path, _SELFMODEL_COMPLETE="complete_bash", **environment)
        return done.stdout.split()

    assert completed("selfmodel logs ") == ["info", "verify", "salvage", "import", "export"]
    assert "--kinds" in completed("selfmodel diagnose --k")
    script = selfmodel(cwd=tmp_path, _SELFMODEL_COMPLETE="source_bash").stdout
    assert "_SELFMODEL_COMPLETE=complete_bash" in script
    assert script.rstrip().endswith("selfmodel")


@pytest.mark.parametrize(
    ("command", "options"),
    [
        ("ablate", {"--cases": "--case", "--gaps": "--gap", "--damages": "--damage"}),
        ("paper", {"--comparators": "--comparator"}),
    ],
)
def test_older_spellings_work_and_are_not_on_the_page(
    command: str, options: dict[str, str], tmp_path: Path
):
    shown = selfmodel(*command.split(), "--help", cwd=tmp_path).stdout.split()
    for older, option in options.items():
        refused = [
            selfmodel(*command.split(), name, "1,,x", "--out", "out", cwd=tmp_path).stderr
            for name in (older, option)
        ]

        assert refused[0] == refused[1]
        assert refused[0].startswith("error: ")
        assert option in shown
        assert older not in shown
