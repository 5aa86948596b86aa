"""The recording of a Unitree Go2 on a stand, which is not in the repository."""

from pathlib import Path

import pytest

STAND = Path(__file__).parents[3] / "shared" / "samples" / "go2-stand"

recorded = pytest.mark.skipif(
    not STAND.exists(),
    reason="no recording of a Go2 in ../shared/samples/go2-stand: docs/results/go2.md has its "
    "source and its format",
)
