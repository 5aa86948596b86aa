"""Promises of how a robot is stopped: by signals whenever they come, by cleanup, by a watchdog."""

import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, suppress
from itertools import count
from pathlib import Path
from types import FrameType

import dm_env
import numpy as np
import pytest

import selfmodel
from selfmodel.errors import InputError, TrialError, WorkError, describe
from selfmodel.logs.inspection import verify
from selfmodel.physical.environment import EnvironmentRobot
from selfmodel.physical.safety import (
    STOP_SIGNALS,
    HeldIterator,
    Terminated,
    cleanup,
    handle_stop_signals,
    hold_stop_signals,
    release_stop_signals,
    status_of,
)
from selfmodel.trials.signals import SIGNALS
from tests.helpers.bench import CONTROLLER, QUADRUPED, STEPS, Bench, bench_robot, driven, logged

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
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
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
        time.sleep(0.3)
        process.send_signal(number)

        assert process.wait(timeout=30) == STATUS[number]


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


def interrupted_at(
    place: int, number: signal.Signals, folder: Path, watchdog: float | None
) -> tuple[int, list[str]]:
    """Runs a trial with a signal at a line; returns the number of lines, and what was executed."""
    bench = Bench()
    with suppress(KeyboardInterrupt), handle_stop_signals():
        end = at_line(place, lambda: signal.raise_signal(number))
        try:
            logged(bench, folder, steps=3, watchdog=watchdog)
        finally:
            lines = end()
    return lines, bench.done


@pytest.mark.parametrize("watchdog", [None, 5.0])
@pytest.mark.parametrize("cases", [6, pytest.param(40, marks=pytest.mark.process)])
def test_at_whatever_line_a_signal_comes_the_robot_is_stopped_last_and_the_log_is_whole(
    tmp_path: Path, cases: int, watchdog: float | None
):
    (tmp_path / "whole").mkdir()
    lines, _ = interrupted_at(-1, signal.SIGTERM, tmp_path / "whole", watchdog)
    rng = random.Random(5)  # noqa: S311  # moments, not secrets
    for case, place in enumerate(sorted(rng.sample(range(lines), min(cases, lines)))):
        (folder := tmp_path / str(case)).mkdir()
        _, executed = interrupted_at(place, STOP_SIGNALS[case % 3], folder, watchdog)
        files = [path.name for path in folder.iterdir()]
        assert not executed or executed[-1] == "stop", f"at line {place} of {lines}"
        assert files in ([], ["trial.mcap"]), f"at line {place} of {lines}: {executed}"
        if files:
            assert verify(folder / "trial.mcap").log.status in ("stopped", "finished")
        else:
            assert "step" not in executed


FAILURES = (OSError("the port is gone"), WorkError("the robot does not answer"))
REASONS = (KeyboardInterrupt("Ctrl-C"), ZeroDivisionError("a bug"))


def failing(failure: Exception) -> AbstractContextManager[None]:
    def end() -> None:
        raise failure

    return cleanup(end)


@pytest.mark.parametrize(("failure", "reason"), [*zip(FAILURES, REASONS, strict=True)], ids=repr)
def test_what_ended_a_block_goes_on_and_a_failing_end_is_a_note_to_it(
    reason: BaseException, failure: Exception
):
    with pytest.raises(type(failure)) as alone, failing(failure):
        pass
    assert alone.value is failure
    with pytest.raises(type(reason)) as raised, failing(failure):
        raise type(reason)(*reason.args)
    assert describe(raised.value) == f"{reason}; {failure}"


def test_a_bug_at_the_end_is_not_hidden_in_a_note():
    bug = AttributeError("no such method")
    with pytest.raises(AttributeError, match="no such method"), failing(bug):
        raise KeyboardInterrupt


LIMIT = 0.1


class Hanging(Bench):
    """A robot whose driver hangs in a step until it is let go, and sends its targets only then."""

    def __init__(self, at: int) -> None:
        super().__init__()
        self.at, self.go = at, threading.Event()
        self.executed, self.hanging = [], lambda: None

    def step(self, action: np.ndarray) -> dm_env.TimeStep:
        """Hangs at the step."""
        if self.step_number + 1 == self.at:
            self.hanging()
            self.go.wait(30)
        self.executed.append("targets")
        return super().step(action)

    def stop(self) -> None:
        """Stops, while the driver hangs."""
        self.executed.append("stop")


@pytest.fixture
def bench() -> Iterator[Hanging]:
    made = Hanging(7)
    yield made
    made.go.set()


def test_a_driver_that_hangs_is_stopped_and_its_log_is_whole(bench: Hanging, tmp_path: Path):
    with pytest.raises(TrialError, match=r"the driver did not return from step within 0\.1 s"):
        logged(bench, tmp_path, watchdog=LIMIT)
    log = verify(tmp_path / "trial.mcap").log

    assert bench.executed[-1] == "stop"
    assert (log.status, log.trial.trajectory.steps) == ("stopped", 7)
    assert log.reason == (
        "HangError: the driver did not return from step within 0.1 s; "
        "nor within another 0.1 s, after the safe command"
    )


def test_a_driver_that_returns_late_is_stopped_again_since_it_may_have_sent_targets(
    bench: Hanging, tmp_path: Path
):
    with pytest.raises(TrialError):
        logged(bench, tmp_path, watchdog=LIMIT)
    before = len(bench.executed)
    bench.go.set()
    until = time.monotonic() + 10
    while len(bench.executed) < before + 2 and time.monotonic() < until:
        time.sleep(0.01)

    assert bench.executed[before:] == ["targets", "stop"]


def test_a_driver_that_still_hangs_is_not_driven_again(bench: Hanging):
    physical = bench_robot(bench, watchdog=LIMIT)
    with pytest.raises(TrialError, match="did not return"):
        list(physical.run(CONTROLLER, STEPS))
    with pytest.raises(TrialError, match="has not returned from a call of an earlier trial"):
        list(physical.run(CONTROLLER, STEPS))


def test_a_signal_ends_a_trial_whose_driver_hangs_before_the_watchdog_does(
    bench: Hanging, tmp_path: Path
):
    main = threading.main_thread().ident

    def signal_a_waiting_thread() -> None:
        time.sleep(0.05)  # a wait that is about to begin is not interrupted
        signal.pthread_kill(main, signal.SIGTERM)

    bench.hanging = signal_a_waiting_thread
    stop = bench.stop

    def stop_and_let_go() -> None:
        stop()
        if "targets" in bench.executed:  # not before the first step
            bench.go.set()

    bench.stop = stop_and_let_go
    with pytest.raises(Terminated):
        logged(bench, tmp_path, watchdog=20.0)

    assert bench.executed[-3:] == ["stop", "targets", "stop"]
    assert verify(tmp_path / "trial.mcap").log.reason == "Terminated: SIGTERM"


def test_a_watchdog_changes_nothing_where_the_driver_is_in_time():
    with_one, without = (
        driven(Bench({3: None, 5: TimeoutError()}), watchdog=watchdog) for watchdog in (10.0, None)
    )

    for name in SIGNALS:
        assert with_one[name].tobytes() == without[name].tobytes()
    assert "selfmodel driver" not in {thread.name for thread in threading.enumerate()}


@pytest.mark.parametrize("watchdog", [0.0, float("nan"), float("inf")])
def test_a_watchdog_without_a_time_is_refused(watchdog: float):
    with pytest.raises(InputError, match="a watchdog needs a time of more than 0 s"):
        bench_robot(Bench(), watchdog=watchdog)
    with pytest.raises(InputError, match=r"and stop=, .* got 1.0 and no function"):
        EnvironmentRobot(Bench(), QUADRUPED, watchdog=1.0)
