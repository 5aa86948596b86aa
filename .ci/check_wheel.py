"""Checks what a wheel holds: one top-level name, and the files that no module's import would miss.

Usage: python .ci/check_wheel.py dist/selfmodel-….whl
"""

import sys
import zipfile
from pathlib import Path

NEEDED = (
    *("selfmodel/py.typed", "selfmodel/__init__.pyi", "selfmodel/robot/__init__.pyi"),
    *("selfmodel/tasks/quadruped.xml", "selfmodel/tasks/hexapod.xml"),
    *("selfmodel/cli/foxglove-layout.json", "selfmodel/cli/options.toml"),
    "selfmodel/figures.mplstyle",
    "selfmodel/studies/paper_page.md",
    "selfmodel/report/template.html",
)


def main(wheel: Path) -> None:
    """Exits with a sentence where a wheel is not as it should be."""
    names = zipfile.ZipFile(wheel).namelist()
    top = {name.split("/")[0] for name in names if ".dist-info/" not in name}
    if top != {"selfmodel"}:
        sys.exit(f"{wheel}: expected the one top-level name selfmodel, got {sorted(top)}")
    missing = set(NEEDED) - set(names)
    if missing:
        sys.exit(f"{wheel}: lacks {sorted(missing)}")
    sys.stdout.write(f"{wheel.name}: {len(names)} files, one top-level name\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
