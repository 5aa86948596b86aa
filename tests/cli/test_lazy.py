"""Commands are imported when they run: the help pages of groups import none of them."""

import subprocess
import sys
from pathlib import Path

import pytest

HEAVY = ("mujoco", "dm_control", "scipy", "numpy", "rich", "matplotlib")

HELP = """
import sys
from selfmodel.cli import main
try:
    main()
except SystemExit as end:
    assert end.code == 0, end
print(*sys.modules)
"""


@pytest.mark.process
@pytest.mark.parametrize("words", [["--help"], ["--version"], ["suite", "-h"], ["logs", "-h"]])
def test_the_help_of_a_group_imports_nothing_heavy(words: list[str], tmp_path: Path):
    done = subprocess.run(
        [sys.executable, "-c", HELP, *words],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    imported = done.stdout.splitlines()[-1].split()

    assert not set(HEAVY) & set(imported)
    assert not any(module.startswith("selfmodel.studies") for module in imported)


@pytest.mark.process
@pytest.mark.parametrize("command", ["info", "verify", "salvage"])
def test_commands_that_read_logs_import_no_simulator(command: str, tmp_path: Path):
    done = subprocess.run(
        [sys.executable, "-c", HELP, "logs", command, "--help"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )

    assert not {"mujoco", "dm_control"} & set(done.stdout.splitlines()[-1].split())
