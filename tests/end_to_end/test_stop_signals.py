"""Commands that a signal ends: completely and with its status, or killed with all but a flush."""

import mmap
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import redirect_stdout
from io import StringIO
from multiprocessing.context import ForkServerContext, ForkServerProcess
from pathlib import Path

import numpy as np
import pytest
from typer.core import TyperGroup

from selfmodel.controllers.controller import CommandSource
from selfmodel.logs import LogError, TrialLog, read_log
from selfmodel.logs.salvage import salvage
from selfmodel.logs.writer import FLUSH_STEPS
from selfmodel.physical.safety import STOP_SIGNALS
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trajectory import Sample
from tests.helpers.command import SMALL, selfmodel

ROOT = Path(__file__).parents[2]
STATUS = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGHUP: 129}


@pytest.mark.parametrize("number", STOP_SIGNALS)
def test_a_stop_signal_ends_a_command_with_its_status_and_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: signal.Signals
):
    run = SimulatedRobot.run

    def signalled(self: SimulatedRobot, controller: CommandSource, steps: int) -> Iterator[Sample]:
        for k, sample in enumerate(run(self, controller, steps)):
            if k == 70:
                signal.raise_signal(number)
            yield sample

    monkeypatch.setattr(SimulatedRobot, "run", signalled)
    done = selfmodel("trial", "quadruped", "--steps", "90", "--out", "a.mcap", cwd=tmp_path)
    monkeypatch.undo()
    saved = selfmodel("logs", "salvage", "a.mcap.part", "--out", "b.mcap", cwd=tmp_path)

    assert (done.returncode, done.stdout) == (STATUS[number], "")
    assert done.stderr == "error: interrupted: the steps so far are in a.mcap.part\n"
    assert "saved 70 of 90 steps" in saved.stdout


@pytest.mark.process
@pytest.mark.search
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_stop_signal_to_a_study_and_its_workers_leaves_no_process(
    tmp_path: Path, number: signal.Signals
):
    study = ("ablate", "--robots", "quadruped", "--seeds", "9", *SMALL, "--out", "run")
    process = subprocess.Popen(
        [sys.executable, "-m", "selfmodel", *study, "--steps", "60"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    until = time.monotonic() + 200
    while not list(tmp_path.glob("run/*/*/cell.json")):
        assert process.poll() is None
        assert time.monotonic() < until
        time.sleep(0.1)
    os.killpg(process.pid, number)  # as timeout and a terminal do
    # Ends when the last process, workers included, has closed the pipes.
    told, errors = process.communicate(timeout=60)

    assert (process.returncode, told) == (STATUS[number], "")
    assert "Traceback" not in errors
    assert "failed" not in errors
    assert "the same command continues with the rest" in errors.splitlines()[-1]


@pytest.mark.parametrize("number", STOP_SIGNALS)
def test_a_stop_signal_while_arguments_are_parsed_has_its_own_status(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: signal.Signals
):
    def signalled(*_: object) -> None:
        signal.raise_signal(number)

    monkeypatch.setattr(TyperGroup, "parse_args", signalled)
    done = selfmodel("logs", "verify", "a.mcap", cwd=tmp_path)

    assert (done.returncode, done.stderr) == (STATUS[number], "error: interrupted\n")


IMPORT_SIGNALLED = """
import runpy, signal, sys

class Signalled:
    def find_spec(self, name, *_):
        if name == "selfmodel.cli":
            signal.raise_signal(signal.SIGINT)

sys.meta_path.insert(0, Signalled())
runpy.run_module("selfmodel", run_name="__main__")
"""


@pytest.mark.process
def test_ctrl_c_while_the_command_line_is_imported_ends_it_without_a_traceback(tmp_path: Path):
    done = subprocess.run(
        [sys.executable, "-c", IMPORT_SIGNALLED],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        check=False,
    )

    assert (done.returncode, done.stderr) == (-signal.SIGINT, b"")


STEPS, KILLS = 400, 4
TRIAL = ("trial", "quadruped", "--steps", str(STEPS), "--seed", "5", "--out")


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
        for name in SIGNALS:
            assert trajectory[name].tobytes() == true[name][: trajectory.steps].tobytes()

    assert ends["interrupted"] > 0
