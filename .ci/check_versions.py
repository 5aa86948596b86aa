"""Uses a wheel with the lowest and the highest allowed versions: a trial, a diagnosis, a report.

Usage: python .ci/check_versions.py dist/selfmodel-….whl

The lowest and the highest versions of the dependencies are installed with Python 3.11 and 3.12,
each in an environment of its own. A Python that is not on this machine is named and skipped.
"""

import shutil
import subprocess
import sys
import tempfile
import tomllib
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from pathlib import Path

from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parents[1]
SHORT = ("--steps", "80")
LOGS = ("before.mcap", "after.mcap")
COMMANDS = (
    ("recover", "--help"),
    ("trial", "quadruped", "--out", "before.mcap", "--stage", "before", *SHORT),
    ("trial", "quadruped", "--out", "after.mcap", "--damage", "break:front_left_knee", *SHORT),
    ("diagnose", *LOGS, "--population", "8", "--generations", "2", "--kinds", "break", "--json"),
    ("report", *LOGS, "--diagnosis", "printed.json", "--out", "report.html"),
)


def main(wheel: Path) -> None:
    """Runs the four checks; exits with what failed."""
    with ThreadPoolExecutor(2) as pool:
        every = product((11, 12), (lowest(), []))
        found = list(pool.map(lambda one: check(wheel, *one), every))
    if not any(map(interpreter, (11, 12))):
        sys.exit("nothing was checked: install Python 3.11 or 3.12")
    failures = [text for text in found if text]
    if failures:
        sys.exit("\n".join(failures))


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


def check(wheel: Path, minor: int, versions: list[str]) -> str | None:
    """Installs a wheel for Python 3.minor, with some versions of its dependencies, and uses it.

    Returns:
        The command that failed, and what it said; None if all is well.
    """
    name = f"Python 3.{minor}, {'lowest' if versions else 'highest'} versions"
    python = interpreter(minor)
    if python is None:
        sys.stdout.write(f"{name}: not checked, for there is no Python 3.{minor} here\n")
        return None
    with tempfile.TemporaryDirectory() as folder:
        installed = f"{folder}/venv/bin/python"
        pip = (sys.executable, "-m", "pip", "--python", installed, "install", "--quiet")
        for command in (
            (python, "-m", "venv", "--without-pip", "venv"),
            (*pip, "--no-compile", str(wheel), *versions),  # most modules are never imported here
            *((installed, "-m", "selfmodel", *command) for command in COMMANDS),
        ):
            done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
            if done.returncode:
                return f"{name}: {' '.join(command)}\n{done.stderr}"
            Path(folder, "printed.json").write_text(done.stdout, encoding="utf-8")
    sys.stdout.write(f"{name}: trial, diagnosis and report work\n")
    return None


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve())
