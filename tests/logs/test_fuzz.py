"""Nothing silent: no random damage to a log goes unnoticed, takes long or fills the memory."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("cases", [150, pytest.param(3_000, marks=pytest.mark.fuzz)])
def test_no_damage_is_silent_slow_or_large(cases: int):
    command = [sys.executable, "-m", "tests.logs.fuzz", "--count", str(cases)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)

    assert sum(told["outcomes"].values()) == cases
    assert told["outcomes"]["CorruptError"] > cases / 2
    assert told["outcomes"]["TruncatedError"] > cases / 10
    assert told["salvages"]["saved"] > cases / 20
    assert told["slowest_seconds"] < 5
    assert told["memory_megabytes"] < 1000
