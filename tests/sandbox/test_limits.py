import subprocess
import sys

import pytest

LOWERED = """
import resource
import sys
import tempfile
from pathlib import Path

from selfmodel.sandbox.budget import Budget
from selfmodel.sandbox.limits import restrict

resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 10**12))
resource.setrlimit(resource.RLIMIT_CPU, (5, 7))
restrict(Budget(time=1800), Path(tempfile.gettempdir()))
print(resource.getrlimit(resource.RLIMIT_FSIZE)[0], *resource.getrlimit(resource.RLIMIT_CPU))
"""


@pytest.mark.process
def test_a_limit_that_is_lower_already_is_not_raised():
    found = subprocess.run(
        [sys.executable, "-c", LOWERED], capture_output=True, text=True, check=True
    )

    assert found.stdout.split() == ["1000", "5", "7"]
