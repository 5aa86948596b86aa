"""Which library there is to draw with; what needs one is skipped where there is none."""

import os
import subprocess
import sys

import pytest

from selfmodel.cli.render import WITHOUT_SCREEN, draws as works

WORKS = next(filter(works, WITHOUT_SCREEN), None)
"""The value of ``MUJOCO_GL`` with which MuJoCo draws."""

draws = pytest.mark.skipif(
    WORKS is None,
    reason="MuJoCo draws with neither EGL nor OSMesa here: apt-get install libosmesa6",
)


def drawing(program: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Runs a Python program that draws, and returns its output."""
    return subprocess.run(
        [sys.executable, "-c", program, *arguments],
        env={**os.environ, "MUJOCO_GL": str(WORKS)},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
