"""A browser for tests; what needs one is skipped without."""

import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
DRIVER = ROOT / ".ci" / "browser"

BROWSERS = ("chromium", "chromium-browser", "google-chrome")

CHROMIUM = os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, BROWSERS)), None)
"""The browser that tests drive."""

browses = pytest.mark.skipif(
    not (DRIVER / "node_modules" / ".ready").exists() or CHROMIUM is None,
    reason="no browser to look at a page with: apt-get install chromium, and make browser",
)


def read_report(report: Path, *frames: int) -> dict[str, Any]:
    """What a report shows in a headless browser: see ``.ci/browser/read_report.mjs``."""
    return _driven("read_report.mjs", str(report), *map(str, frames))


def read_failures(*reports: Path) -> list[dict[str, Any]]:
    """What is shown of each report without WebGL: see ``.ci/browser/read_failures.mjs``."""
    return _driven("read_failures.mjs", *map(str, reports))


def _driven(script: str, *arguments: str) -> Any:  # noqa: ANN401  # JSON
    done = subprocess.run(
        ["node", str(DRIVER / script), *arguments],
        env={**os.environ, "CHROMIUM": str(CHROMIUM)},
        capture_output=True,
        text=True,
        check=False,
        timeout=180,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)
