"""Promises of driving a robot in another process, over a socket, in real time.

What is asserted are marks and messages; how fast this machine is, is not.
"""

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from selfmodel.errors import counted
from selfmodel.logs.inspection import verify
from selfmodel.tasks.walking import environment, motion_capture
from tests.helpers.code_blocks import blocks
from tests.helpers.command import selfmodel
from tests.helpers.robots.socket_robot import OBSERVED, STOP, TIMESTEP, slow_quadruped

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples" / "drive_a_robot.py"
PAGE = ROOT / "docs" / "how-to" / "drive-a-robot.md"


@contextmanager
def robot(folder: Path, **failures: float | str) -> Iterator[str]:
    """A robot in another process; gives its port."""
    process = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "tests.helpers.robots.socket_robot",
            folder / "heard",
            json.dumps(failures),
        ],
        cwd=ROOT,
        env={**os.environ, "MUJOCO_GL": "disable"},
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        yield process.stdout.readline().strip()
    finally:
        process.kill()
        process.communicate()


def driver(folder: Path, port: str, *options: str) -> subprocess.Popen[str]:
    command = [sys.executable, EXAMPLE, "127.0.0.1", port, folder / "trial.mcap", *options]
    return subprocess.Popen(
        command,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT), "MUJOCO_GL": "disable"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def heard(folder: Path) -> list[int]:
    """The numbers of the messages that the robot has heard, in order."""
    with contextlib.suppress(FileNotFoundError):
        return [int(line) for line in (folder / "heard").read_text().split()]
    return []


@pytest.mark.process
def test_delays_and_silence_are_marked_and_the_trial_goes_on(tmp_path: Path):
    with robot(tmp_path, **{"30": 0.04, "90": "silent", "91": "silent"}) as port:
        told, errors = (process := driver(tmp_path, port)).communicate(timeout=120)
    assert process.returncode == 0, errors
    assert told == f"250 steps: {tmp_path / 'trial.mcap'}\n"
    log = verify(tmp_path / "trial.mcap").log
    trajectory, timing = log.trial.trajectory, log.timing

    assert (log.status, log.reason, trajectory.steps) == ("finished", "", 250)
    assert timing is not None
    assert np.array_equal(trajectory.late, timing.late)
    assert timing.late[[30, 90, 91]].all()
    assert timing.missing[[90, 91]].all()
    assert np.array_equal(np.isnan(trajectory["sensors"]).any(axis=1), timing.missing)
    assert np.isfinite(trajectory["commands"]).all()
    # Real time: a robot that moves 20 ms a step cannot be done sooner.
    assert timing.elapsed[-1] > 249 * TIMESTEP
    assert np.all(np.diff(timing.elapsed)[[29, 89, 90]] > [0.06, 0.1, 0.1])
    assert heard(tmp_path) == [STOP, *range(250), STOP]
    # The robot moves one step a message, so what it observed can be had again.
    for k, seen in enumerate(observed(trajectory["commands"])):
        for name in OBSERVED:
            assert timing.missing[k] or np.array_equal(trajectory[name][k], seen[name])


def observed(commands: np.ndarray) -> Iterator[dict[str, np.ndarray]]:
    """What the robot observes that follows some targets."""
    env = environment(slow_quadruped(), time_limit=1e3)
    observe = motion_capture(env)
    yield observe(env.reset().observation)
    for targets in commands[:-1]:
        yield observe(env.step(targets).observation)


@pytest.mark.process
def test_a_dropped_connection_stops_the_robot_and_leaves_a_whole_log(tmp_path: Path):
    with robot(tmp_path, **{"70": "hang up"}) as port:
        process = driver(tmp_path, port, "--watchdog", "30")
        _, errors = process.communicate(timeout=120)
    verified = verify(tmp_path / "trial.mcap")
    log = verified.log

    assert process.returncode == 1
    assert "the environment failed: ConnectionError: the robot closed the connection" in errors
    assert "the environment failed: ConnectionError: the robot closed the connection" in log.reason
    assert (log.status, log.trial.trajectory.steps) == ("stopped", 70)
    assert heard(tmp_path) == [STOP, *range(71), STOP]
    told = selfmodel("logs", "info", "trial.mcap", cwd=tmp_path, PYTHONPATH=str(ROOT))
    assert f"of quadruped, stopped: {log.reason}" in " ".join(told.stdout.split("\n"))
    late = counted(int(log.timing.late.sum()), "step")
    missing = counted(int(log.timing.missing.sum()), "observation")
    assert f"clock: {late} late, {missing} missing" in told.stdout
    told = selfmodel("logs", "verify", "trial.mcap", cwd=tmp_path, PYTHONPATH=str(ROOT))
    stopped = f"ok: trial.mcap: 70 steps, stopped ({log.reason})"
    assert told.stdout == f"{stopped}; SHA-256 {verified.digest}\n"


@pytest.mark.process
def test_the_operator_is_told_that_the_robot_could_not_be_stopped(tmp_path: Path):
    with robot(tmp_path, **{"40": "die"}) as port:
        _, errors = (process := driver(tmp_path, port)).communicate(timeout=120)

    assert process.returncode == 1
    # Whether it hangs up, resets or refuses is a matter of the moment.
    assert re.match(
        r"the environment failed: Connection\w*Error: .*; "
        r"the safe command could not be sent: Connection\w*Error: .*; what was observed",
        errors,
    )


@pytest.mark.process
def test_a_robot_that_is_not_there_is_said_so_and_can_be_tried_again(tmp_path: Path):
    for _ in range(2):
        _, errors = (process := driver(tmp_path, "1")).communicate(timeout=120)  # nobody is there
        assert process.returncode == 1
        assert errors.startswith("the safe command could not be sent: ConnectionRefusedError: ")
        assert errors.endswith("; there is no log\n")
        assert list(tmp_path.iterdir()) == []
    (tmp_path / "trial.mcap").touch()
    _, errors = driver(tmp_path, "1").communicate(timeout=120)
    assert errors.endswith("trial.mcap exists, and is not overwritten: choose another name\n")
    assert "Traceback" not in errors


@pytest.mark.process
@pytest.mark.parametrize(
    ("number", "status", "ends", "reason"),
    [
        (signal.SIGTERM, 143, "", "Terminated: SIGTERM"),
        (signal.SIGINT, -signal.SIGINT, "KeyboardInterrupt", "KeyboardInterrupt"),
    ],
)
def test_a_stop_signal_stops_the_robot_and_leaves_a_whole_log(
    tmp_path: Path, number: signal.Signals, status: int, ends: str, reason: str
):
    with robot(tmp_path) as port:
        process = driver(tmp_path, port)
        while len(heard(tmp_path)) < 60 and process.poll() is None:
            time.sleep(0.02)
        process.send_signal(number)
        _, errors = process.communicate(timeout=120)
    log = verify(tmp_path / "trial.mcap").log

    assert process.returncode == status
    assert errors.strip().rpartition("\n")[2] == ends
    assert (log.status, log.reason) == ("stopped", reason)
    first, *commands, last = heard(tmp_path)
    assert (first, last) == (STOP, STOP)
    assert commands == list(range(len(commands)))
    assert len(commands) - 1 <= log.trial.trajectory.steps <= len(commands)


@pytest.mark.process
@pytest.mark.search
def test_the_trial_of_the_docs_runs(tmp_path: Path):
    (block,) = (block for block in blocks(PAGE) if block.language == "python")
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "MUJOCO_GL": "disable"}
    subprocess.run([sys.executable, "-c", block.text], cwd=tmp_path, env=environment, check=True)
    log = verify(tmp_path / "walk.mcap").log

    assert (log.status, log.trial.trajectory.steps) == ("finished", 100)
    assert log.timing is not None
    assert not log.timing.late.any()
