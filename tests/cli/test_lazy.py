"""Commands are imported when they run: no help page imports what their work needs."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.test_help_page import GROUPS, commands

HEAVY = {"mujoco", "dm_control", "scipy", "pandas", "rich", "matplotlib", "mcap"}

HELP = """
import sys
from selfmodel.cli import main
for words in {pages}:
    sys.argv[1:] = [*words, "--help"]
    try:
        main()
    except SystemExit as end:
        assert end.code == 0, end
print(*sys.modules)
"""


@pytest.mark.process
@pytest.mark.parametrize(
    ("pages", "heavy"), [(list(GROUPS), {*HEAVY, "numpy"}), (list(commands()), HEAVY)]
)
def test_no_help_page_imports_anything_heavy(
    pages: list[tuple[str, ...]], heavy: set[str], tmp_path: Path
):
    done = subprocess.run(
        [sys.executable, "-c", HELP.format(pages=pages)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    imported = done.stdout.splitlines()[-1].split()

    assert not heavy & set(imported)
    assert not any(module.startswith("selfmodel.studies") for module in imported)


@pytest.mark.process
def test_a_recovery_imports_at_most_150_modules_of_selfmodel_and_no_search_before_it_begins():
    code = "import sys, selfmodel.cli.recover; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    imported = done.stdout.split()

    assert sum(name.split(".")[0] == "selfmodel" for name in imported) <= 150
    assert not {"cma", "scipy.stats", "matplotlib"} & set(imported)
