"""Checks that the newest run of ``make demo`` is the one that the README describes.

The same processor repeats the numbers; another one may round differently, and contacts are chaotic,
so that evolution finds other gaits there, as with another seed. Case 1 with the seeds 0 to 2 at a
gap of 0.1 walked 12.7 to 21.9 m, 2.6 to 3.7 m and 12.0 to 13.8 m, at most 0.29 of the first
displacement after the loss and at least 0.61 recovered (docs/results/data/recoveries-robust.jsonl).
"""

import json
import re
import sys
from pathlib import Path

TOLERANCE, LOST, REGAINED = 1 / 5, 1 / 3, 1 / 2
"""In first displacements: of each number, 3.1 m, which two of those three seeds keep to; most that
may be left after the loss, and least that must be recovered, to which all keep."""


def main() -> None:
    """Exits with a sentence where the run and the README differ."""
    folder = max(Path("runs").glob("quadruped-*"), key=lambda path: path.stat().st_mtime)
    result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    before, after, *later = [trial["displacement"] for trial in result["trials"]]
    recovered = max(later)
    text = Path("README.md").read_text(encoding="utf-8")
    pattern = r"walks ([\d.]+) m in ten seconds, ([\d.]+) m after the loss, and ([\d.]+) m"
    numbers = re.search(pattern, text)
    if numbers is None:
        sys.exit("README.md: expected the displacements of the demo, and found none")
    stated = [float(number) for number in numbers.groups()]
    for said, walked in zip(stated, (before, after, recovered), strict=True):
        if abs(said - walked) > TOLERANCE * stated[0]:
            sys.exit(f"README.md: the demo walks {said} m; here it walked {walked:.1f} m")
    if not (after < LOST * before and recovered >= REGAINED * before):
        walked = f"{before:.1f} m, {after:.1f} m after the loss and {recovered:.1f} m recovered"
        sys.exit(f"{folder}: expected a walk that is lost and regained, got {walked}")
    if not result["correct"]:
        sys.exit(f"{folder}: the diagnosis of the demo is wrong")


if __name__ == "__main__":
    main()
