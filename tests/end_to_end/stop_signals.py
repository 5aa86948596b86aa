"""Ends a driver by signals at random moments, and checks the robot and the log.

Usage: python -m tests.end_to_end.stop_signals [--count 50] [--seed 11] [--watchdog SECONDS]

Each of SIGINT, SIGTERM and SIGHUP ends COUNT trials. The moments are drawn from every phase of a
trial: before it, while the safe command is sent first, in ``reset``, in a step, between two steps,
while the safe command is sent last, and while the log is finished. A trial passes if the safe
command was the last one that the robot received and was completed, if the log verifies or no step
was logged yet, and if no unfinished file is left.
"""

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from selfmodel.errors import InputError
from selfmodel.logs.inspection import verify
from selfmodel.physical.safety import STOP_SIGNALS
from tests.helpers.signalled_driver import PHASES, STEPS

ROOT = Path(__file__).parents[2]
HIT = tuple(PHASES)[:-1]


@dataclass(frozen=True)
class Ending:
    """How a trial ended.

    Attributes:
        number: The signal.
        phase: What the driver did as the signal was sent; ``none`` if it ended before.
        status: Exit status; minus the number of a signal that killed the program.
        log: Status of the log; empty without a log.
        fault: What is wrong; empty if nothing is.
    """

    number: signal.Signals
    phase: str
    status: int
    log: str
    fault: str


def end_trial(
    folder: Path, number: signal.Signals, phase: str, rng: random.Random, watchdog: float | None
) -> Ending:
    """Runs a driver in a folder that a signal ends at a random moment of a phase."""
    count = rng.randrange(1, STEPS) if phase in ("step", "between") else 1
    moment = (number.value, phase, count, rng.uniform(0.0, PHASES[phase]))
    limit = () if watchdog is None else (watchdog,)
    done = subprocess.run(
        [
            *(sys.executable, "-m", "tests.helpers.signalled_driver"),
            *map(str, (folder, *moment, *limit)),
        ],
        cwd=ROOT,
        env={**os.environ, "MUJOCO_GL": "disable"},
        capture_output=True,
        check=False,
        text=True,
        timeout=120,
    )
    landed = folder / "phase"
    there = landed.read_text() if landed.exists() else "none"
    return _judged(folder, number, there, done.returncode, done.stderr)


def _judged(folder: Path, number: signal.Signals, phase: str, status: int, errors: str) -> Ending:
    sent = (folder / "sent").read_text().split()
    files = sorted(path.name for path in folder.glob("trial*"))
    log = ""
    faults = []
    if files == ["trial.mcap"]:
        try:
            log = verify(folder / "trial.mcap").log.status
        except InputError as error:
            faults.append(f"the log does not verify: {error}")
    elif files:
        faults.append(f"files {files}")
    elif "step" in sent:
        faults.append("no log")
    if sent and sent[-2:] != ["stop", "stopped"]:
        faults.append(f"the last commands are {sent[-3:]}")
    # The same for a shell: the signal itself, before the trial and for SIGINT, or its exit status.
    if status not in (0, -number, 128 + number):
        faults.append(f"exit status {status}: {errors.strip().splitlines()[-1:]}")
    return Ending(number, phase, status, log, "; ".join(faults))


def endings(count: int, seed: int, watchdog: float | None = None) -> list[Ending]:
    """Ends that many trials by each signal; the phases take turns."""
    rng = random.Random(seed)  # noqa: S311  # moments, not secrets
    found = []
    for number in STOP_SIGNALS:
        for turn in range(count):
            with tempfile.TemporaryDirectory() as folder:
                phase = HIT[turn % len(HIT)]
                found.append(end_trial(Path(folder), number, phase, rng, watchdog))
    return found


def main() -> None:
    """Prints a line per signal, and each fault; the exit status is 1 if there is one."""
    parser = argparse.ArgumentParser(description="Ends drivers by signals at random moments.")
    parser.add_argument("--count", type=int, default=50)
    parser.add_argument("--seed", type=int, default=11)
    parser.add_argument("--watchdog", type=float)
    given = parser.parse_args()
    found = endings(given.count, given.seed, given.watchdog)
    for number in STOP_SIGNALS:
        own = [one for one in found if one.number == number]
        good = sum(not one.fault for one in own)
        print(f"{number.name}: {good} of {len(own)}")
        for what in ("phase", "log", "status"):
            print(f"  {what}: {dict(Counter(getattr(one, what) for one in own))}")
    for one in found:
        if one.fault:
            print(f"{one.number.name} in phase {one.phase!r}: {one.fault}")
    sys.exit(any(one.fault for one in found))


if __name__ == "__main__":
    main()
