"""Nothing silent: no random damage to a log goes unnoticed, takes long or fills the memory."""

import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
CASES = 3_000


def test_no_damage_is_silent_slow_or_large():
    command = [sys.executable, "-m", "tests.logs.fuzz", "--count", str(CASES)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)

    assert sum(told["outcomes"].values()) == CASES
    assert told["outcomes"]["CorruptError"] > CASES / 2
    assert told["outcomes"]["TruncatedError"] > CASES / 10
    assert told["salvages"]["saved"] > CASES / 20
    assert told["slowest_seconds"] < 5
    assert told["memory_megabytes"] < 1000
