"""Commands that a stop signal ends: completely, and with its exit status."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.core import TyperGroup

from selfmodel.controllers.controller import CommandSource
from selfmodel.physical.safety import STOP_SIGNALS
from selfmodel.physical.simulated import SimulatedRobot
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
