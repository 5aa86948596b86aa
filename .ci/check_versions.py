"""Checks the allowed versions: a trial, a diagnosis and a report with the lowest and the highest.

Usage: python .ci/check_versions.py

The lowest versions of the dependencies are installed with Python 3.11, the highest with 3.12, each
in an environment of its own. A Python that is not on this machine is named and skipped.
"""

import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parents[1]
SHORT = ("--steps", "200")
COMMANDS = (
    ("trial", "quadruped", "--out", "before.mcap", "--stage", "before", *SHORT),
    ("trial", "quadruped", "--out", "after.mcap", "--damage", "break:front_left_knee", *SHORT),
    ("diagnose", "before.mcap", "after.mcap", "--population", "8", "--generations", "2"),
    ("report", "before.mcap", "after.mcap", "--out", "report.html"),
)


def main() -> None:
    """Runs both checks; the first command that fails ends them."""
    for minor, which in ((11, "lowest"), (12, "highest")):
        python = interpreter(minor)
        if python is None:
            sys.stdout.write(f"no Python 3.{minor} here: the {which} versions are not checked\n")
            continue
        with tempfile.TemporaryDirectory() as folder:
            check(python, Path(folder), lowest() if which == "lowest" else [])
        sys.stdout.write(f"Python 3.{minor}, {which} versions: trial, diagnosis and report work\n")


def lowest() -> list[str]:
    """Returns a requirement of the lowest allowed version of each dependency."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    requirements = [Requirement(text) for text in project["dependencies"]]
    return [
        f"{requirement.name}=={bound.version}"
        for requirement in requirements
        for bound in requirement.specifier
        if bound.operator == ">="
    ]


def interpreter(minor: int) -> str | None:
    """Returns the path of a Python 3.minor that runs; None if there is none."""
    versions = sorted(Path.home().glob(f".pyenv/versions/3.{minor}.*/bin/python"))
    for name in (f"python3.{minor}", *map(str, versions)):
        path = shutil.which(name)
        if path and not subprocess.run([path, "-V"], capture_output=True, check=False).returncode:
            return path
    return None


def check(python: str, folder: Path, versions: list[str]) -> None:
    """Installs selfmodel with some versions of its dependencies, and runs the commands."""
    subprocess.run([python, "-m", "venv", str(folder / "venv")], check=True)
    installed = str(folder / "venv" / "bin" / "python")
    pip = (installed, "-m", "pip", "install", "--quiet", "--disable-pip-version-check")
    subprocess.run([*pip, str(ROOT), *versions], check=True)
    for command in COMMANDS:
        done = subprocess.run(
            [installed, "-m", "selfmodel", *command],
            cwd=folder,
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode:
            sys.exit(
                f"{' '.join(command)} with {versions or 'the newest versions'}:\n{done.stderr}"
            )


if __name__ == "__main__":
    main()
