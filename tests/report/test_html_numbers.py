import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.skipif(shutil.which("node") is None, reason="no Node.js")

SCRIPT = Path(__file__).with_name("numbers.mjs")


@pytest.fixture(scope="module")
def found() -> dict[str, Any]:
    done = subprocess.run(
        ["node", str(SCRIPT)], capture_output=True, text=True, check=False, timeout=20
    )

    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_integers_have_all_digits_and_other_numbers_six(found: dict[str, Any]):
    assert found["shown"] == ["1234567", "123456789012", "0.123457", "-3", "\N{EN DASH}"]


def test_a_shortened_number_has_all_of_its_digits_under_the_pointer(found: dict[str, Any]):
    assert found["whole"] == [None, "0.12345678", None, "-1234567.8", None, None]


def test_neighbouring_numbers_have_no_ticks(found: dict[str, Any]):
    assert found["counts"] == [0, 0, 0]
    assert found["ticks"] == [[-0.2, 0, 0.2, 0.4], [200, 400, 600, 800, 1000]]
