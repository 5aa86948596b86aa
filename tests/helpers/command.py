"""The command line as its users run it."""

import os
import subprocess
import sys
from pathlib import Path

SMALL = ("--population", "8", "--generations", "2")

DIAGNOSIS = (
    *("diagnosis", "verdict", "rivals", "unseen", "test", "intact_distance"),
    *("outside", "calibration"),
)
"""What JSON says of a diagnosis, be it of a recovery's or of logs."""


def selfmodel(*arguments: str, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Runs the command in a folder, with its output piped."""
    return subprocess.run(
        [sys.executable, "-m", "selfmodel", *arguments],
        cwd=cwd,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
