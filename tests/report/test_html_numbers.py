import json
import shutil
import subprocess
from pathlib import Path

import pytest

SCRIPT = Path(__file__).with_name("numbers.mjs")


@pytest.mark.skipif(shutil.which("node") is None, reason="no Node.js")
def test_integers_have_all_digits_and_neighbouring_numbers_no_ticks():
    done = subprocess.run(
        ["node", str(SCRIPT)], capture_output=True, text=True, check=False, timeout=20
    )

    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["shown"] == ["1234567", "123456789012", "0.123457", "-3", "\N{EN DASH}"]
    assert found["counts"] == [0, 0, 0]
    assert found["ticks"] == [[-0.2, 0, 0.2, 0.4], [200, 400, 600, 800, 1000]]
