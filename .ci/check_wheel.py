"""Checks a wheel: one top-level name, the robots' models in it, and it works where it is installed.

Usage: python .ci/check_wheel.py dist/selfmodel-….whl
"""

import subprocess
import sys
import tempfile
import venv
import zipfile
from pathlib import Path

NEEDED = (
    *("selfmodel/py.typed", "selfmodel/__init__.pyi", "selfmodel/robot/__init__.pyi"),
    *("selfmodel/tasks/quadruped.xml", "selfmodel/tasks/hexapod.xml"),
    *("selfmodel/cli/foxglove-layout.json", "selfmodel/cli/options.toml"),
    "selfmodel/studies/figures.mplstyle",
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
    with tempfile.TemporaryDirectory() as folder:
        run_installed(wheel.resolve(), Path(folder))
    sys.stdout.write(f"{wheel.name}: {len(names)} files, one top-level name, works installed\n")


def run_installed(wheel: Path, folder: Path) -> None:
    """Runs a trial and makes a report with the wheel, in an environment far from the sources."""
    venv.create(folder / "venv", with_pip=True)
    python = folder / "venv" / "bin" / "python"
    constraints = Path("constraints.txt").resolve()
    install = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*install, "--constraint", str(constraints), str(wheel)], check=True)
    (folder / "results.csv").write_text("robot,correct\nhexapod,true\n", encoding="utf-8")
    commands = (["robots"], ["trial", "hexapod", "--out", "trial.mcap"], ["report", "."])
    for arguments in commands:
        subprocess.run([str(python), "-m", "selfmodel", *arguments], check=True, cwd=folder)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
