"""A program that drives a robot and sends itself a signal at a moment of its trial.

Usage: python -m tests.helpers.signalled_driver FOLDER NUMBER PHASE TIME DELAY [WATCHDOG]

The signal comes DELAY seconds after the program enters a phase for the TIME-th time. The folder
gets ``sent``, the commands that the robot received, and ``phase``, in which the signal came.
"""

import os
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import dm_env
import numpy as np

from selfmodel.logs.log_file import LogFile
from selfmodel.logs.writer import TrialWriter
from tests.helpers.bench import Bench, logged

STEPS = 40
PHASES = {
    "begin": 0.02,
    "first stop": 0.01,
    "reset": 0.01,
    "step": 0.004,
    "between": 0.0005,
    "last stop": 0.01,
    "finish": 0.01,
    "end": 0.0,
}
"""What the program does, and about how many seconds it takes."""


class Announced(Bench):
    """A robot that takes its time, writes down what it receives, and announces its phases.

    Args:
        folder: Folder of the trial.
        number: Signal.
        phase: Phase after whose beginning the signal comes.
        count: How often the phase has begun then.
        delay: Seconds from there to the signal.
    """

    def __init__(self, folder: Path, number: int, phase: str, count: int, delay: float) -> None:
        super().__init__()
        self._folder, self._number, self._delay = folder, number, delay
        self._awaited, self._left, self._phase = phase, count, ""
        self._sent = os.open(folder / "sent", os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        self.clock = time.monotonic

    def enter(self, phase: str) -> None:
        """Announces a phase."""
        self._phase = phase
        self._left -= phase == self._awaited
        if phase == self._awaited and self._left == 0:
            threading.Thread(target=self._send_signal, daemon=True).start()

    def _send_signal(self) -> None:
        time.sleep(self._delay)
        (self._folder / "phase").write_text(self._phase)
        os.kill(os.getpid(), self._number)

    def take_time(self, phase: str, command: str) -> None:
        """Receives a command and executes it."""
        self.enter(phase)
        os.write(self._sent, f"{command}\n".encode())
        time.sleep(PHASES[phase])

    def reset(self) -> dm_env.TimeStep:
        """Moves to the initial pose."""
        self.take_time("reset", "reset")
        result = super().reset()
        self.enter("between")
        return result

    def step(self, action: np.ndarray) -> dm_env.TimeStep:
        """Moves for a step."""
        self.take_time("step", "step")
        result = super().step(action)
        self.enter("between")
        return result

    def stop(self) -> None:
        """Stops, which is done only when it is done to its end."""
        self.take_time("last stop" if "reset" in self.done else "first stop", "stop")
        os.write(self._sent, b"stopped\n")
        super().stop()


def announcing(bench: Announced, phase: str, method: Callable[..., Any]) -> Callable[..., Any]:
    """Returns a method that announces a phase first."""

    def announced(self: object, *arguments: object) -> object:
        bench.enter(phase)
        return method(self, *arguments)

    return announced


def main(bench: Announced, folder: Path, watchdog: float | None) -> None:
    """Runs a trial of a few tenths of a second."""
    LogFile.finish = announcing(bench, "finish", LogFile.finish)
    TrialWriter.add = announcing(bench, "between", TrialWriter.add)
    bench.enter("begin")
    logged(bench, folder, STEPS, watchdog=watchdog)
    bench.enter("end")


if __name__ == "__main__":
    sys.setswitchinterval(1e-4)  # the thread of the signal gets its turn within a short phase
    place, number, phase, count, delay, *seconds = sys.argv[1:]
    main(
        Announced(Path(place), int(number), phase, int(count), float(delay)),
        Path(place),
        float(seconds[0]) if seconds else None,
    )
