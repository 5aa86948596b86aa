"""Kills of commands at random moments: only a ``.part`` is incomplete, and a repeat is equal.

    python -m tests.end_to_end.kills --count 140 --seed 0

Studies (``ablate``, ``suite run``), which resume, have a harness of their own:
``tests.studies.kill_study``.
"""

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import mujoco
import numpy as np

from selfmodel.controllers.controller import Controller, draw_genomes
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT
from selfmodel.logs import LogError
from selfmodel.logs.controllers import controller_bytes
from selfmodel.logs.inspection import verify
from selfmodel.logs.salvage import salvage
from selfmodel.robot.designs import DESIGNS
from selfmodel.tasks import ROBOTS
from tests.logs.recordings.driver import mapping, record


@dataclass(frozen=True)
class Command:
    """Command to kill.

    Attributes:
        name: Name of the subcommand.
        arguments: Arguments; the working folder is empty.
        outputs: Files or folders that the command writes.
    """

    name: str
    arguments: tuple[str, ...]
    outputs: tuple[str, ...]


def commands(inputs: Path) -> list[Command]:
    """The commands, and their inputs in a folder."""
    small = ("--steps", "150", "--population", "6", "--generations", "3", "--threads", "1")
    return [
        Command(
            "trial",
            ("trial", "quadruped", "--out", "walk.mcap", "--steps", "1500", "--seed", "3"),
            ("walk.mcap",),
        ),
        Command(
            "recover",
            ("recover", "quadruped", "--case", "1", *small, "--out", "run", "--trials", "1"),
            ("run",),
        ),
        Command(
            "calibrate",
            ("calibrate", str(inputs / "healthy.mcap"), "--out", "model.xml", "--threads", "1"),
            ("model.xml",),
        ),
        Command(
            "import",
            (
                *("logs", "import", str(inputs / "bag"), "--mapping", str(inputs / "map.toml")),
                *("--out", "imported.mcap"),
            ),
            ("imported.mcap",),
        ),
    ]


def prepare(inputs: Path) -> None:
    """Writes the inputs of the commands."""
    robot = ROBOTS["quadruped"].robot()
    design = DESIGNS["network"](robot, None)
    genome = draw_genomes(np.random.default_rng(1), (design.weights,))
    driver = Controller(design, genome)
    (inputs / "walk.npz").write_bytes(controller_bytes(driver))
    record(inputs / "bag", robot, INTACT, driver, steps=300)
    (inputs / "map.toml").write_text(mapping(robot, 300, "walk.npz"))
    run(("trial", "quadruped", "--out", "healthy.mcap", "--steps", "300", "--gap", "0.1"), inputs)


def run(arguments: tuple[str, ...], folder: Path) -> None:
    """Runs a command to its end."""
    subprocess.run([*SELFMODEL, *arguments], cwd=folder, check=True, capture_output=True)


SELFMODEL = (sys.executable, "-m", "selfmodel")


def kill(command: Command, folder: Path, moment: float, how: Callable[[int], None]) -> bool:
    """Starts a command, kills it after a time, and returns whether it was still running."""
    process = subprocess.Popen(
        [*SELFMODEL, *command.arguments],
        cwd=folder,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    time.sleep(moment)
    running = process.poll() is None
    if running:
        how(process.pid)
    process.wait()
    return running


def kill_process(pid: int) -> None:
    """Kills the process that the user sees."""
    os.kill(pid, signal.SIGKILL)


def kill_group(pid: int) -> None:
    """Kills the process with those that it started."""
    os.killpg(pid, signal.SIGKILL)


def problems(folder: Path, inputs: Path) -> list[str]:
    """Files that are neither complete nor a ``.part``."""
    found = []
    for path in sorted(folder.rglob("*")):
        if path.is_dir() or path.suffix == ".part":
            continue
        try:
            if path.suffix == ".mcap":
                verify(path)
            elif path.suffix == ".json":
                json.loads(path.read_bytes())
            elif path.suffix == ".xml":
                mujoco.MjModel.from_xml_path(str(path))
            else:
                found.append(f"{path.name}: unexpected")
        except (LogError, InputError, ValueError) as error:
            found.append(f"{path.name}: {error}")
    return found + [f"{path.name}: left among the inputs" for path in inputs.rglob("*.part")]


def salvaged(folder: Path) -> list[str]:
    """Outcome for each log that a kill left unfinished."""
    outcomes = []
    for part in folder.rglob("*.mcap.part"):
        out = part.with_name("salvaged.mcap")
        try:
            salvage(part, out)
            verify(out)
            outcomes.append("salvaged")
        except LogError:
            outcomes.append("not one step")
        out.unlink(missing_ok=True)
    return outcomes


def content(folder: Path, command: Command) -> dict[str, bytes]:
    """Bytes of the outputs that must not depend on an earlier kill."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for name in command.outputs
        for path in sorted([folder / name, *(folder / name).rglob("*")])
        if path.suffix in (".mcap", ".xml")
    }


def repeat(folder: Path, command: Command, expected: dict[str, bytes]) -> str | None:
    """Runs a killed command again as its message advises; returns what differs."""
    for path in folder.rglob("*.part"):
        path.unlink()
    if (folder / "run").exists():  # a run needs a new folder
        (folder / "run").rename(folder / "killed")
    if not all((folder / name).exists() for name in command.outputs):
        run(command.arguments, folder)
    return None if content(folder, command) == expected else "the repeat differs"


def main() -> None:
    """Kills commands and prints the outcomes; the exit status is 1 if a promise was broken."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=140)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    rng = random.Random(given.seed)  # noqa: S311  # moments of kills
    broken: list[str] = []
    outcomes: Counter[str] = Counter()
    with TemporaryDirectory() as root:
        inputs = Path(root) / "inputs"
        inputs.mkdir()
        prepare(inputs)
        every = commands(inputs)
        reference: dict[str, tuple[float, dict[str, bytes]]] = {}
        for command in every:
            folder = Path(root) / command.name
            folder.mkdir()
            start = time.perf_counter()
            run(command.arguments, folder)
            reference[command.name] = (time.perf_counter() - start, content(folder, command))
        for number in range(given.count):
            command = every[number % len(every)]
            seconds, expected = reference[command.name]
            folder = Path(root) / f"{command.name}-{number}"
            folder.mkdir()
            moment = rng.uniform(0, seconds)
            how = rng.choice((kill_process, kill_group))
            running = kill(command, folder, moment, how)
            found = problems(folder, inputs)
            for outcome in salvaged(folder):
                outcomes[f"{command.name}: .part, {outcome}"] += 1
            different = repeat(folder, command, expected)
            found += [different] if different else []
            outcomes[f"{command.name}: {'killed' if running else 'had ended'}"] += 1
            for problem in found:
                broken.append(f"{number} {command.name} after {moment:.2f} s: {problem}")
                print(f"BROKEN {broken[-1]}", flush=True)
    for outcome, count in sorted(outcomes.items()):
        print(f"{outcome}: {count}")
    print(f"{given.count} kills, {len(broken)} promises broken")
    sys.exit(1 if broken else 0)


if __name__ == "__main__":
    main()
