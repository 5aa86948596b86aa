"""``selfmodel trial``, killed at random moments: its file contains all but the last steps."""

import mmap
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from selfmodel.logs import LogError, TrialLog, read_log
from selfmodel.logs.salvage import salvage
from selfmodel.logs.writer import FLUSH_STEPS
from selfmodel.trials.signals import SIGNALS

ROOT = Path(__file__).parents[2]
STEPS, KILLS = 1000, 4

TAPPED = """
import mmap, sys
from selfmodel.cli import main
from selfmodel.physical.simulated import SimulatedRobot

counter = open(sys.argv.pop(1), "r+b")
page = mmap.mmap(counter.fileno(), 8)
run = SimulatedRobot.run

def tapped(self, controller, steps):
    for k, sample in enumerate(run(self, controller, steps)):
        page[:] = (k + 1).to_bytes(8, "little")
        yield sample

SimulatedRobot.run = tapped
main()
"""
"""The command as it is, but that it counts its steps where they outlive a kill."""


def start(folder: Path, number: int) -> tuple[subprocess.Popen[bytes], mmap.mmap]:
    """Starts a trial; returns its process and the count of its steps."""
    counter = folder / f"{number}.count"
    counter.write_bytes(bytes(8))
    with counter.open("r+b") as file:
        page = mmap.mmap(file.fileno(), 8)
    command = [sys.executable, "-c", TAPPED, counter, "trial", "quadruped", "--seed", "5"]
    process = subprocess.Popen(
        [*command, "--out", folder / f"{number}.mcap"],
        cwd=ROOT,
        env={**os.environ, "MUJOCO_GL": "disable"},
        stdout=subprocess.DEVNULL,
    )
    return process, page


def kill_at(process: subprocess.Popen[bytes], page: mmap.mmap, step: int, delay: float) -> int:
    """Kills a trial some moment after a step; returns how many steps it had taken."""
    while process.poll() is None and int.from_bytes(page, "little") < step:
        time.sleep(2e-4)
    time.sleep(delay)
    process.kill()
    process.wait()
    return int.from_bytes(page, "little")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The log of a trial that was not killed."""
    folder = tmp_path_factory.mktemp("whole")
    process, _ = start(folder, 0)
    assert process.wait() == 0
    return folder / "0.mcap"


def read_or_salvage(log: Path) -> TrialLog:
    """The trial in a finished log, or the trial salvaged from an unfinished one."""
    if log.exists():
        return read_log(log)
    part = log.with_name(log.name + ".part")
    try:
        return read_log(part)  # whole, and killed before it got its name
    except LogError:
        saved = log.with_name("saved-" + log.name)
        salvage(part, saved)
        return read_log(saved)


@pytest.mark.process
def test_no_kill_costs_more_than_the_steps_of_one_flush(whole: Path, tmp_path: Path):
    true = read_log(whole).trial.trajectory
    rng = np.random.default_rng(11)
    moments = [*rng.integers(1, STEPS + 1, KILLS - 1), STEPS]  # the last while it is finished
    delays = rng.uniform(0, 0.02, KILLS)
    ends = {"finished": 0, "interrupted": 0}
    for number in range(KILLS):
        process, page = start(tmp_path, number)
        taken = kill_at(process, page, moments[number], delays[number])
        read = read_or_salvage(tmp_path / f"{number}.mcap")
        ends[read.status] += 1
        trajectory = read.trial.trajectory
        assert taken - FLUSH_STEPS <= trajectory.steps <= taken
        for signal in SIGNALS:
            assert trajectory[signal].tobytes() == true[signal][: trajectory.steps].tobytes()

    assert ends["interrupted"] > 0
