"""The README's commands, Python blocks and links work."""

import re
import shlex
from pathlib import Path

import pytest
from PIL import Image

from tests.helpers.code_blocks import Block, blocks, commands
from tests.helpers.command import SMALL, succeeds

ROOT = Path(__file__).parents[2]
README = ROOT / "README.md"
PAGES = [README, *sorted(ROOT.glob("docs/**/*.md"))]
DEMO = "selfmodel recover quadruped --case 1"
"""The command of `make demo`; CI runs `make demo` itself."""


def steps() -> list[str | Block]:
    """The README's commands and Python blocks, in the order in which a reader runs them."""
    found: list[str | Block] = []
    for block in blocks(README):
        if block.is_run:
            found += [block] if block.language == "python" else map(shlex.join, commands(block))
    return found


def is_in_ci(step: str | Block) -> bool:
    """Returns whether CI runs a command by itself."""
    return isinstance(step, str) and (step.startswith("make ") or step == DEMO)


def name_of(step: str | Block) -> str:
    """The command, or the line of a Python block, as a test's name."""
    return step if isinstance(step, str) else f"python, line {step.line}"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder in which all commands run: a command may read the files of earlier commands."""
    return tmp_path_factory.mktemp("readme")


JAM = re.compile(r"back_left_shoulder( is stuck at 0\.30 rad|=0\.3, explained)")
"""What every step after the trials says of the second one, by a command or in Python."""

SHORTER = {"trial": ("--steps", "140"), "diagnose": SMALL, "report": SMALL}
"""Options by which commands take seconds for minutes; the block of Python reads the same logs."""


@pytest.mark.process
@pytest.mark.usefixtures("coarse_calibration")
@pytest.mark.parametrize("step", [one for one in steps() if not is_in_ci(one)], ids=name_of)
def test_a_reader_can_run_and_is_told_what_is_wrong(
    step: str | Block, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
):
    if isinstance(step, str):
        words = shlex.split(step)[1:]
        told = succeeds(*words, *SHORTER.get(words[0], ()), cwd=folder).stdout
    else:
        monkeypatch.chdir(folder)
        small = "settings=selfmodel.Settings(generations=2).scaled(8), healthy="
        exec(step.text.replace("healthy=", small), {})  # noqa: S102  # the page's own code
        told = capsys.readouterr().out

    assert "selfmodel trial " in name_of(step) or JAM.search(told), told


def test_every_command_is_this_projects_and_what_make_runs_is_run_by_ci():
    ci = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    made = {target for words in re.findall(r"\bmake ([^;\n]+)", ci) for target in words.split()}
    found = [step for step in steps() if isinstance(step, str)]

    assert found
    for command in found:
        assert command.startswith(("selfmodel ", "make ")), command
        if command.startswith("make "):
            assert made.issuperset(command.split()[1:]), command
    assert f"$(BIN)/{DEMO}" in (ROOT / "Makefile").read_text(encoding="utf-8")


def test_the_numbers_of_the_demo_are_those_of_its_picture():
    with Image.open(ROOT / "docs" / "figures" / "lanes.png") as picture:
        numbers = [picture.info[stage] for stage in ("before", "after", "recovery")]

    text = README.read_text(encoding="utf-8")
    before, after, recovered = numbers
    assert f"walks {before} m in ten seconds, {after} m after the loss, and {recovered} m" in text


def test_a_block_of_the_readme_is_run_or_says_why_not():
    known = ("sh", "python", "text")

    assert [block.line for block in blocks(README) if block.language not in known] == []


def test_every_link_to_a_file_leads_somewhere():
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for target, place in re.findall(r"\]\((?!https?:)([^)#]*)(?:#([^)]*))?\)", text):
            file = page.parent / target if target else page
            assert file.exists(), f"{page}: {target}"
            assert not place or place in headings(file), f"{page}: {file.name} has no #{place}"


def headings(page: Path) -> set[str]:
    """The anchors of a page's headings."""
    found = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in found}
