"""One word per concept: documentation and docstrings do not use the glossary's retired words."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
GLOSSARY = ROOT / "docs" / "glossary.md"
PAGES = sorted(ROOT.glob("docs/**/*.md"))
CODE = sorted(
    path
    for folder in ("selfmodel", "tasks", "comparators", "logs", "examples", "benchmarks")
    for path in ROOT.glob(f"{folder}/**/*.py")
    if not any(parent.is_symlink() for parent in path.parents)
)


def terms() -> list[list[str]]:
    """The rows of the glossary's tables: term, meaning, replaced terms."""
    lines = GLOSSARY.read_text(encoding="utf-8").partition("## Retired words")[0].splitlines()
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if "|" in line]
    return [row for row in rows if row[0] != "term" and set(row[0]) != {"-"}]


def retired() -> list[tuple[re.Pattern[str], str]]:
    """The retired words, each with its replacement."""
    block = GLOSSARY.read_text(encoding="utf-8").partition("## Retired words")[2]
    lines = block.partition("```text\n")[2].partition("\n```")[0].splitlines()
    pairs = [line.split("=>") for line in lines]
    return [(re.compile(word.strip(), re.IGNORECASE), use.strip()) for word, use in pairs]


def prose(markdown: str) -> str:
    """The text of a page with its code blanked out; lines keep their numbers."""
    fences = re.compile(r"^```.*?^```", flags=re.DOTALL | re.MULTILINE)
    markdown = fences.sub(lambda block: "\n" * block[0].count("\n"), markdown)
    return re.sub(r"`[^`\n]*`", "``", markdown)


def docstrings(source: str) -> Iterator[tuple[int, str]]:
    """Yields every docstring with its first line's number, those of attributes included."""
    for node in ast.walk(ast.parse(source)):
        text = getattr(node.value, "value", None) if isinstance(node, ast.Expr) else None
        if isinstance(text, str):
            yield node.lineno, re.sub(r"``[^`]*``", blanked, text)


def blanked(code: re.Match[str]) -> str:
    """Code in backticks without its text; lines keep their numbers."""
    return "``" + "\n" * code[0].count("\n") + "``"


def found(path: Path, first: int, text: str) -> list[str]:
    """The retired words in a text, as ``file:line: word => replacement``."""
    return [
        f"{path.relative_to(ROOT)}:{first + text.count(chr(10), 0, match.start())}: "
        f"{match[0]!r} => {use}"
        for word, use in retired()
        for match in word.finditer(text)
    ]


def test_every_term_has_a_meaning_and_one_row():
    names = [row[0] for row in terms()]

    assert len(names) >= 50
    assert all(len(row) == 3 and row[1] for row in terms())
    assert len(set(names)) == len(names)


def test_no_term_is_retired():
    assert len(retired()) >= 20
    for term, meaning, _ in terms():
        for word, _ in retired():
            assert not word.search(prose(f"{term}: {meaning}")), (term, word.pattern)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_pages_use_the_glossary(page: Path):
    text = prose(page.read_text(encoding="utf-8"))
    if page == GLOSSARY:  # its third column has the retired terms
        text = re.sub(r"\|[^|\n]*\|$", "|", text, flags=re.MULTILINE)

    assert "\n".join(found(page, 1, text)) == ""


@pytest.mark.parametrize("file", CODE, ids=lambda file: str(file.relative_to(ROOT)))
def test_docstrings_use_the_glossary(file: Path):
    source = file.read_text(encoding="utf-8")
    lines = [line for first, text in docstrings(source) for line in found(file, first, text)]

    assert "\n".join(lines) == ""
