"""A recovery that the tests of commands share: its folder, and what it printed."""

import json
from pathlib import Path

import pytest

from tests.helpers.command import SMALL, Done, succeeds

KINDS = "break,sensor"
SHORT = ("quadruped", "--case", "4", *SMALL, "--kinds", KINDS, "--steps", "60", "--trials", "1")


@pytest.fixture(scope="session")
def recovery(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Done]:
    """A folder in which a recovery with short trials ran, and the command that ran."""
    folder = tmp_path_factory.mktemp("short")
    done = succeeds("recover", *SHORT, "--out", "run", "--json", cwd=folder)
    return folder, done


@pytest.fixture(scope="session")
def short(recovery: tuple[Path, Done]) -> tuple[Path, dict]:
    """A folder in which a recovery with short trials ran, and the JSON that it printed."""
    folder, done = recovery
    return folder, json.loads(done.stdout)
