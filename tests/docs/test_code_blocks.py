"""Code blocks of the documentation: each is run, or a comment before it gives the reason."""

import re
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from selfmodel.cli import app
from tests.helpers.code_blocks import blocks, commands
from tests.helpers.command import SMALL

ROOT = Path(__file__).parents[2]
PAGES = sorted(ROOT.glob("docs/**/*.md"))
DATA = ("text", "toml", "xml")
"""Languages of output and of files."""

SEARCH = re.compile(
    r"selfmodel (recover|diagnose|calibrate|ablate|suite run|paper|render)"
    r"|\b(recover|diagnose|evolve_controller)\("
)
"""Commands and calls that run an evolutionary algorithm, a calibration or that draw for seconds."""


def expanded(words: list[str]) -> list[str]:
    """The arguments with file patterns replaced by the files of the current folder."""
    files = [sorted(map(str, Path().glob(word))) if "*" in word else [word] for word in words]
    return [name for names in files for name in names]


def shortened(words: list[str]) -> list[str]:
    """The arguments of a command, with a small search, few kinds or one process where it may."""
    if words[0] in ("ablate", "suite") and "--out" in words and "--workers" not in words:
        return [*words, "--workers", "1"]
    searches = words[0] in ("diagnose", "report", "recover") and "--help" not in words
    small = SMALL if "--population" not in words else ()
    few = ("--kinds", "paper") if "--kinds" not in words else ()
    return [*words, *small, *few] if searches else words


def name_of(page: Path) -> str:
    """The path of a page, as a test's name."""
    return str(page.relative_to(ROOT))


def test_every_block_is_run_or_has_a_reason():
    for page, block in [(one, block) for one in PAGES for block in blocks(one)]:
        place = f"{name_of(page)}:{block.line}"
        if block.language == "sh" and block.is_run:
            for words in commands(block):
                assert words[0] == "selfmodel", f"{place}: {words[0]} cannot be run by this test"
        elif block.language not in ("sh", "python", *DATA):
            assert re.fullmatch(r"\{[a-z-]+\}", block.language), f"{place}: {block.language!r}"


def test_comments_belong_to_blocks():
    for page in PAGES:
        comments = re.findall(r"^<!-- (?:not run|file): .*-->$", page.read_text(), re.MULTILINE)

        assert len(comments) == sum(bool(block.comment) for block in blocks(page)), name_of(page)


def runnable() -> list[object]:
    """The pages with code to run, those with a search marked."""
    pages = [page for page in PAGES if any(block.is_run for block in blocks(page))]
    searches = {
        page: SEARCH.search("".join(block.text for block in blocks(page) if block.is_run))
        for page in pages
    }
    marks = {page: [pytest.mark.search] if searches[page] else [] for page in pages}
    return [pytest.param(page, marks=marks[page], id=name_of(page)) for page in pages]


@pytest.mark.usefixtures("coarse_calibration")
@pytest.mark.parametrize("page", runnable())
def test_code_of_a_page_runs_in_order(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    names: dict[str, object] = {"__name__": "page"}
    for block in blocks(page):
        place = f"{name_of(page)}:{block.line}"
        if block.comment.startswith("file: "):
            (tmp_path / block.comment.removeprefix("file: ")).write_text(block.text)
        elif block.language == "{literalinclude}":
            shutil.copy(page.parent / block.argument, tmp_path)
        elif block.is_run and block.language == "python":
            exec(compile(block.text, place, "exec"), names)  # noqa: S102  # the page's own code
        elif block.is_run:
            for words in commands(block):
                done = CliRunner().invoke(app, shortened(expanded(words[1:])))
                assert done.exit_code == 0, f"{place}: {words}\n{done.output}\n{done.exception!r}"
