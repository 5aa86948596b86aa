"""The README is true: its commands run, its Python runs, its links lead somewhere."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAPER_BUDGET = "selfmodel recover quadruped --case 1"
"""What `make demo` runs; CI runs `make demo` itself."""


def blocks(language: str) -> list[str]:
    """The code blocks of one language."""
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


def commands() -> list[str]:
    """The commands of the shell blocks, without their comments."""
    lines = [line for block in blocks("sh") for line in block.splitlines()]
    return [line.split("#")[0].strip() for line in lines if line.strip()]


def test_every_command_is_run_here_or_by_ci(tmp_path: Path):
    ci = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")

    assert len(commands()) >= 8
    for command in commands():
        if command.startswith("make ") or command == PAPER_BUDGET:
            continue
        assert command.startswith("selfmodel "), command
        arguments = [sys.executable, "-m", *shlex.split(command)]
        done = subprocess.run(arguments, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"{command}\n{done.stderr}"
    for command in (command for command in commands() if command.startswith("make ")):
        assert re.search(rf"\b{command}\b", ci), command
    assert f"$(BIN)/{PAPER_BUDGET}" in makefile
    for block in blocks("python"):
        subprocess.run([sys.executable, "-c", block], cwd=tmp_path, check=True, capture_output=True)


@pytest.mark.parametrize("page", ["README.md", *(f"docs/{p.name}" for p in ROOT.glob("docs/*.md"))])
def test_every_link_to_a_file_leads_somewhere(page: str):
    text = (ROOT / page).read_text(encoding="utf-8")
    targets = re.findall(r"\]\((?!https?:)([^)#]*)(?:#([^)]*))?\)", text)
    files = [((ROOT / page).parent / target if target else ROOT / page) for target, _ in targets]

    assert [file for file in files if not file.exists()] == []
    for file, (_, place) in zip(files, targets, strict=True):
        assert not place or place in headings(file), f"{file.name} has no #{place}"


def headings(page: Path) -> set[str]:
    """What links to the headings of a page are called."""
    found = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in found}
