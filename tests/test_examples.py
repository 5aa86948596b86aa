"""Promises of the examples: each runs as its usage says, and draws or prints what it promises."""

import subprocess
import sys
from pathlib import Path

EXAMPLES = Path(__file__).parents[1] / "examples"


def run(name: str, *arguments: str, cwd: Path) -> str:
    """Runs an example in a folder and returns what it printed."""
    command = [sys.executable, EXAMPLES / name, *arguments]
    return subprocess.run(command, cwd=cwd, check=True, capture_output=True, text=True).stdout


def test_a_recovery_in_python_is_drawn_from_its_logs(tmp_path: Path):
    told = run("recover_in_python.py", "run", cwd=tmp_path)
    run("plot_recovery.py", "run", "figure.png", cwd=tmp_path)

    assert "(the truth: break:back_left_shoulder)" in told
    assert (tmp_path / "figure.png").read_bytes().startswith(b"\x89PNG")
    assert len(list((tmp_path / "run" / "trials").glob("*.mcap"))) == 5


def test_an_ablation_in_python_goes_on_where_it_was(tmp_path: Path):
    first = run("ablation.py", "folder", cwd=tmp_path)
    again = run("ablation.py", "folder", cwd=tmp_path)

    assert "12 rows, 0 failed: folder/results.csv" in first
    assert "GridBegins(total=4, finished=4)" in again
    assert len((EXAMPLES / "ablation.py").read_text(encoding="utf-8").splitlines()) < 40
