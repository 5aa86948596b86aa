"""Checks that the newest run of ``make demo`` is the one that the README describes.

Contacts are chaotic, and processors round differently: the same seed walks a few metres more or
less on another machine, so the numbers are compared within a quarter of the first displacement.
"""

import json
import re
import sys
from pathlib import Path


def main() -> None:
    """Exits with a sentence where the run and the README differ."""
    folder = max(Path("runs").glob("quadruped-*"), key=lambda path: path.stat().st_mtime)
    result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    before, after, *later = [trial["displacement"] for trial in result["trials"]]
    run = (before, after, max(later))
    text = Path("README.md").read_text(encoding="utf-8")
    pattern = r"walks ([\d.]+) m in ten seconds, ([\d.]+) m after the loss, and ([\d.]+) m"
    numbers = re.search(pattern, text)
    if numbers is None:
        sys.exit("README.md: expected the displacements of the demo, and found none")
    for stated, walked in zip(map(float, numbers.groups()), run, strict=True):
        if abs(stated - walked) > before / 4:
            sys.exit(f"README.md: the demo walks {stated} m; here it walked {walked:.1f} m")
    if not result["correct"]:
        sys.exit(f"{folder}: the diagnosis of the demo is wrong")


if __name__ == "__main__":
    main()
