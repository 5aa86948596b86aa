"""Promises of the stop signals: each ends a trial in order, whenever it comes."""

import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import count
from pathlib import Path
from types import FrameType

import dm_env
import numpy as np
import pytest

import selfmodel
from selfmodel.logs.inspection import verify
from selfmodel.physical.safety import (
    STOP_SIGNALS,
    HeldIterator,
    Terminated,
    handle_stop_signals,
    hold_stop_signals,
    release_stop_signals,
    status_of,
)
from tests.helpers.bench import Bench, logged

PACKAGE = str(Path(selfmodel.__file__).parents[1])
STATUS = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGHUP: 129}


@pytest.mark.parametrize("number", STOP_SIGNALS)
def test_each_stop_signal_is_an_interruption_with_its_exit_status(number: signal.Signals):
    with pytest.raises(KeyboardInterrupt) as raised, handle_stop_signals():
        signal.raise_signal(number)

    assert isinstance(raised.value, Terminated) == (number != signal.SIGINT)
    assert status_of(raised.value) == STATUS[number]
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


def test_a_signal_that_is_ignored_or_has_a_handler_keeps_its_treatment():
    received = []
    before = {number: signal.getsignal(number) for number in STOP_SIGNALS}
    try:
        signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as under nohup
        signal.signal(signal.SIGTERM, lambda number, _: received.append(number))
        with handle_stop_signals():
            signal.raise_signal(signal.SIGHUP)
            signal.raise_signal(signal.SIGTERM)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)

    assert received == [signal.SIGTERM]


def test_a_held_signal_is_raised_at_the_end_of_the_outer_region():
    done = []
    with pytest.raises(Terminated), handle_stop_signals(), hold_stop_signals():  # noqa: PT012  # all of it is the promise
        with hold_stop_signals():
            signal.raise_signal(signal.SIGTERM)
            done.append("inner")
        done.append("outer")

    assert done == ["inner", "outer"]


def test_a_held_signal_is_raised_before_code_that_may_block():
    done = []
    with pytest.raises(Terminated), handle_stop_signals(), hold_stop_signals():  # noqa: PT012  # all of it is the promise
        signal.raise_signal(signal.SIGTERM)
        with release_stop_signals():
            done.append("driver")

    assert done == []


def test_a_signal_that_a_driver_catches_is_raised_after_it():
    done = []
    with pytest.raises(Terminated), handle_stop_signals(), hold_stop_signals():  # noqa: PT012  # all of it is the promise
        with release_stop_signals():
            try:
                signal.raise_signal(signal.SIGTERM)
            except KeyboardInterrupt:
                done.append("caught")
        done.append("held")

    assert done == ["caught", "held"]


def test_a_repetition_within_milliseconds_is_the_same_signal():
    cleaned_up = []
    with pytest.raises(Terminated), handle_stop_signals():  # noqa: PT012  # all of it is the promise
        try:
            signal.raise_signal(signal.SIGTERM)
        finally:  # as timeout(1) and a terminal that closes do
            signal.raise_signal(signal.SIGTERM)
            signal.raise_signal(signal.SIGHUP)
            cleaned_up.append(True)

    assert cleaned_up


@pytest.mark.process
@pytest.mark.parametrize("number", STOP_SIGNALS)
def test_a_second_signal_ends_the_process_at_once(number: signal.Signals):
    code = (
        "import signal, time\n"
        "from selfmodel.physical.safety import handle_stop_signals\n"
        "with handle_stop_signals():\n"
        "    try:\n"
        f"        signal.raise_signal({number.value})\n"
        "    finally:\n"
        "        print('cleaning up', flush=True)\n"
        "        time.sleep(60)\n"
    )
    command = [sys.executable, "-c", code]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "cleaning up\n"
        time.sleep(0.5)
        process.send_signal(number)

        assert process.wait(timeout=30) == STATUS[number]


@pytest.mark.process
def test_an_uncaught_signal_ends_a_program_quietly_and_with_its_status():
    code = (
        "import os, signal\n"
        "from selfmodel.physical import handle_stop_signals\n"
        "with handle_stop_signals():\n"
        "    os.kill(os.getpid(), signal.SIGTERM)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True)

    assert (done.returncode, done.stderr) == (143, b"")


def test_outside_of_the_main_thread_nothing_is_changed():
    seen = []

    def run() -> None:
        with handle_stop_signals(), hold_stop_signals(), release_stop_signals():
            seen.append(signal.getsignal(signal.SIGTERM))

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()

    assert seen == [signal.SIG_DFL]


def test_a_signal_in_a_generator_is_raised_between_its_items():
    done = []

    def items() -> Iterator[int]:
        try:
            signal.raise_signal(signal.SIGTERM)
            done.append("goes on")
            yield 1
        finally:
            done.append("closed")

    iterator = HeldIterator(items())
    with pytest.raises(Terminated), handle_stop_signals():
        next(iterator)
    iterator.close()

    assert done == ["goes on", "closed"]


class Wire(Bench):
    """A robot that writes down what it has executed to the end."""

    def __init__(self) -> None:
        super().__init__()
        self.executed = []

    def reset(self) -> dm_env.TimeStep:
        """Moves to the initial pose."""
        self.executed.append("reset")
        return super().reset()

    def step(self, action: np.ndarray) -> dm_env.TimeStep:
        """Moves for a step."""
        self.executed.append("step")
        return super().step(action)

    def stop(self) -> None:
        """Stops."""
        super().stop()
        self.executed.append("stop")


def at_line(place: int, act: Callable[[], None]) -> Callable[[], int]:
    """Traces the package, and acts at the line of that place; returns a function that ends it.

    The function returns the number of lines.
    """
    lines = count()
    here = threading.current_thread()

    def trace(frame: FrameType, event: str, _argument: object) -> object:
        if threading.current_thread() is not here or not frame.f_code.co_filename.startswith(
            PACKAGE
        ):
            return None
        if event == "line" and next(lines) == place:
            act()
        return trace

    def end() -> int:
        sys.settrace(before)
        return next(lines)

    before = sys.gettrace()
    sys.settrace(trace)
    return end


def interrupted_at(place: int, number: signal.Signals, folder: Path) -> tuple[int, list[str]]:
    """Runs a trial with a signal at a line; returns the number of lines, and what was executed."""
    wire = Wire()
    with suppress(KeyboardInterrupt), handle_stop_signals():
        end = at_line(place, lambda: signal.raise_signal(number))
        try:
            logged(wire, folder, steps=3)
        finally:
            lines = end()
    return lines, wire.executed


@pytest.mark.parametrize("cases", [6, pytest.param(150, marks=pytest.mark.process)])
def test_at_whatever_line_a_signal_comes_the_robot_is_stopped_last_and_the_log_is_whole(
    tmp_path: Path, cases: int
):
    (tmp_path / "whole").mkdir()
    lines, _ = interrupted_at(-1, signal.SIGTERM, tmp_path / "whole")
    rng = random.Random(5)  # noqa: S311  # moments, not secrets
    for case, place in enumerate(sorted(rng.sample(range(lines), min(cases, lines)))):
        (folder := tmp_path / str(case)).mkdir()
        _, executed = interrupted_at(place, STOP_SIGNALS[case % 3], folder)
        files = [path.name for path in folder.iterdir()]
        assert not executed or executed[-1] == "stop", f"at line {place} of {lines}"
        assert files in ([], ["trial.mcap"]), f"at line {place} of {lines}: {executed}"
        if files:
            assert verify(folder / "trial.mcap").log.status in ("stopped", "finished")
        else:
            assert "step" not in executed
