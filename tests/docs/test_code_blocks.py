"""Code blocks of the documentation: each is run, or a comment before it gives the reason.

A block ``output`` shows what the code before it prints, and is compared with that: line by line,
with ``…`` for what is left out, and a time for any other. A page with such blocks is run as it is
written; of another one, searches and calibrations are made smaller.
"""

import re
import shutil
from contextlib import nullcontext, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

import pytest
from typer.testing import CliRunner

from selfmodel.cli import app
from tests.helpers.calibration import coarse
from tests.helpers.code_blocks import Block, blocks, commands
from tests.helpers.command import SMALL

ROOT = Path(__file__).parents[2]
PAGES = sorted(ROOT.glob("docs/**/*.md"))
SHOWN = "output"
"""Language of what the code before it prints."""

DATA = ("text", "toml", "xml", SHOWN)
"""Languages of output and of files."""

AS_WRITTEN = [page for page in PAGES if any(block.language == SHOWN for block in blocks(page))]
"""Pages that show what their code prints."""

PROGRESS = re.compile(r"^.*: \d+%, about .* left\n|^\[\d+/\d+\] .*\n", re.MULTILINE)
"""Lines of progress: how many there are is a question of time."""

TIME = re.compile(r"\d+(?=/s\b)|[\d.]+(?= s\b)")
"""Rates and durations, each of which stands for every other."""

SEARCH = re.compile(
    r"selfmodel (recover|diagnose|calibrate|watch|ablate|suite run|paper|render)"
    r"|\b(recover|diagnose|evolve)\("
)
"""Commands and calls that run an evolutionary algorithm, a calibration or that draw for seconds."""


def expanded(words: list[str]) -> list[str]:
    """The arguments with file patterns replaced by the files of the current folder."""
    files = [sorted(map(str, Path().glob(word))) if "*" in word else [word] for word in words]
    return [name for names in files for name in names]


def in_one_process(words: list[str]) -> list[str]:
    """The arguments of a command, of which a study is computed by one process: to the same bits."""
    is_run = words[0] == "ablate" or words[:2] == ["suite", "run"]
    is_study = is_run and "--out" in words
    return [*words, "--workers", "1"] if is_study and "--workers" not in words else words


def shortened(words: list[str]) -> list[str]:
    """The arguments of a command, with a small search and few kinds where it may."""
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


def comparable(text: str) -> list[str]:
    """The lines of an output, without progress, times and spaces at their ends."""
    text = TIME.sub("N", PROGRESS.sub("", text))
    return [line.rstrip() for line in text.splitlines()]


def assert_shown(block: Block, printed: str, place: str) -> str:
    """Compares a block with what was printed, and returns what follows there."""
    shown = [
        r"(?:.*\n)*?" if line == "…" else re.escape(line).replace("…", ".*") + r"\n"
        for line in comparable(block.text)
    ]
    lines = "".join(f"{line}\n" for line in comparable(printed))
    found = re.search("^" + "".join(shown), lines, re.MULTILINE)
    assert found, f"{place}: expected\n{block.text}\nin\n{printed}"
    return lines[found.end() :]


def test_an_output_is_compared_by_whole_lines_and_only_its_times_may_differ():
    block = Block(1, SHOWN, "", "best 0.21, 45/s\n…\nright: 1 of 1, …\n", "")
    printed = (
        "first\nbest 0.21, 9/s\nbetween\nfit: 4%, about 2 s left\nright: 1 of 1, 3.5 times\nlast\n"
    )

    assert assert_shown(block, printed, "page:1") == "last\n"
    for wrong in (
        printed.replace("0.21", "0.22"),
        printed.replace("best", "the best"),
        printed.replace("right: 1", "right: 0"),
        printed.replace("9/s", "9/s or so"),
    ):
        with pytest.raises(AssertionError, match="page:1: expected"):
            assert_shown(block, wrong, "page:1")


def test_all_code_of_a_tutorial_is_run_as_it_is_written_and_shows_its_output():
    tutorials = [page for page in PAGES if page.parent.name == "tutorials" and blocks(page)]
    lessons = [page for page in tutorials if any(block.is_run for block in blocks(page))]

    assert lessons
    assert set(lessons) <= set(AS_WRITTEN)
    for page, block in [(one, block) for one in lessons for block in blocks(one)]:
        place = f"{name_of(page)}:{block.line}"
        assert block.language != "text", f"{place}: expected {SHOWN}, which is compared"
        assert not block.comment.startswith("not run: "), place


def runnable() -> list[object]:
    """The pages with code to run, those with a search marked."""
    pages = [page for page in PAGES if any(block.is_run for block in blocks(page))]
    searches = {
        page: SEARCH.search("".join(block.text for block in blocks(page) if block.is_run))
        for page in pages
    }
    marks = {page: [pytest.mark.search] if searches[page] else [] for page in pages}
    return [pytest.param(page, marks=marks[page], id=name_of(page)) for page in pages]


@pytest.mark.parametrize("page", runnable())
def test_code_of_a_page_runs_in_order(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    names: dict[str, object] = {"__name__": "page"}
    printed = ""
    with nullcontext() if page in AS_WRITTEN else coarse():
        for block in blocks(page):
            place = f"{name_of(page)}:{block.line}"
            if block.comment.startswith("file: "):
                (tmp_path / block.comment.removeprefix("file: ")).write_text(block.text)
            elif block.language == "{literalinclude}":
                shutil.copy(page.parent / block.argument, tmp_path)
            elif block.language == SHOWN:
                printed = assert_shown(block, printed, place)
            elif block.is_run:
                printed = run(block, names, place, shorten=page not in AS_WRITTEN)


def run(block: Block, names: dict[str, object], place: str, *, shorten: bool) -> str:
    """Runs a block of Python or commands, and returns what it prints."""
    if block.language == "python":
        with redirect_stdout(StringIO()) as told, redirect_stderr(told):
            exec(compile(block.text, place, "exec"), names)  # noqa: S102  # the page's own code
        return told.getvalue()
    told = StringIO()
    for words in commands(block):
        given = in_one_process(expanded(words[1:]))
        done = CliRunner().invoke(app, shortened(given) if shorten else given)
        assert done.exit_code == 0, f"{place}: {words}\n{done.output}\n{done.exception!r}"
        told.write(done.output)
    return told.getvalue()
