"""``selfmodel trial``, killed at random moments: its file contains all but the last steps."""

import mmap
import multiprocessing
import time
from collections.abc import Iterator
from contextlib import redirect_stdout
from io import StringIO
from multiprocessing.context import ForkServerContext, ForkServerProcess
from pathlib import Path

import numpy as np
import pytest

from selfmodel.controllers.controller import CommandSource
from selfmodel.logs import LogError, TrialLog, read_log
from selfmodel.logs.salvage import salvage
from selfmodel.logs.writer import FLUSH_STEPS
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trajectory import Sample
from tests.helpers.command import selfmodel

STEPS, KILLS = 1000, 4
TRIAL = ("trial", "quadruped", "--seed", "5", "--out")


def tapped_trial(counter: Path, log: Path) -> None:
    """Runs the command as it is, but that it counts its steps where they outlive a kill."""
    run = SimulatedRobot.run

    def tapped(self: SimulatedRobot, controller: CommandSource, steps: int) -> Iterator[Sample]:
        with counter.open("r+b") as file, mmap.mmap(file.fileno(), 8) as page:
            for k, sample in enumerate(run(self, controller, steps)):
                page[:] = (k + 1).to_bytes(8, "little")
                yield sample

    SimulatedRobot.run = tapped  # type: ignore[method-assign]  # of a process that is killed
    with redirect_stdout(StringIO()):
        selfmodel(*TRIAL, str(log), cwd=log.parent)


def kill_at(process: ForkServerProcess, counter: Path, step: int, delay: float) -> int:
    """Kills a trial some moment after a step; returns how many steps it had taken."""
    with counter.open("r+b") as file, mmap.mmap(file.fileno(), 8) as page:
        while process.is_alive() and int.from_bytes(page, "little") < step:
            time.sleep(2e-4)
        time.sleep(delay)
        process.kill()
        process.join()
        return int.from_bytes(page, "little")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The log of a trial that was not killed."""
    folder = tmp_path_factory.mktemp("whole")
    assert selfmodel(*TRIAL, "whole.mcap", cwd=folder).returncode == 0
    return folder / "whole.mcap"


@pytest.fixture(scope="module")
def forks() -> ForkServerContext:
    """Starts processes that need no imports of their own."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([__name__, "selfmodel.cli.trial"])
    return context


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
def test_no_kill_costs_more_than_the_steps_of_one_flush(
    whole: Path, forks: ForkServerContext, tmp_path: Path
):
    true = read_log(whole).trial.trajectory
    rng = np.random.default_rng(11)
    moments = [*rng.integers(1, STEPS + 1, KILLS - 1), STEPS]  # the last while it is finished
    delays = rng.uniform(0, 0.02, KILLS)
    ends = {"finished": 0, "interrupted": 0}
    for number in range(KILLS):
        counter, log = tmp_path / f"{number}.count", tmp_path / f"{number}.mcap"
        counter.write_bytes(bytes(8))
        process = forks.Process(target=tapped_trial, args=(counter, log))
        process.start()
        taken = kill_at(process, counter, moments[number], delays[number])
        read = read_or_salvage(log)
        ends[read.status] += 1
        trajectory = read.trial.trajectory
        assert taken - FLUSH_STEPS <= trajectory.steps <= taken
        for signal in SIGNALS:
            assert trajectory[signal].tobytes() == true[signal][: trajectory.steps].tobytes()

    assert ends["interrupted"] > 0
