"""Promises of the watchdog: a driver that hangs does not keep the safe command from the robot."""

import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import dm_env
import numpy as np
import pytest

from selfmodel.errors import InputError, TrialError
from selfmodel.logs.inspection import verify
from selfmodel.physical.environment import EnvironmentRobot
from selfmodel.physical.safety import Terminated, Watchdog
from selfmodel.trials.signals import SIGNALS
from tests.helpers.bench import CONTROLLER, QUADRUPED, STEPS, Bench, bench_robot, driven, logged

LIMIT = 0.1


class Hanging(Bench):
    """A robot whose driver hangs in a step until it is let go, and sends its targets only then."""

    def __init__(self, at: int) -> None:
        super().__init__()
        self.at, self.go = at, threading.Event()
        self.executed = []

    def reset(self) -> dm_env.TimeStep:
        """Hangs if the step is 0."""
        if self.at == 0:
            self.go.wait(30)
        return super().reset()

    def step(self, action: np.ndarray) -> dm_env.TimeStep:
        """Hangs at the step."""
        if self.step_number + 1 == self.at:
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
    assert (log.status, log.trial.behaviour.steps) == ("stopped", 7)
    assert log.reason == (
        "HangError: the driver did not return from step within 0.1 s; "
        "nor within another 0.1 s, after the safe command"
    )


def test_a_driver_that_hangs_in_its_reset_is_stopped_and_leaves_no_log(tmp_path: Path):
    bench = Hanging(0)
    with pytest.raises(TrialError, match="did not return from reset"):
        logged(bench, tmp_path, watchdog=LIMIT)
    bench.go.set()

    assert bench.executed[-1] == "stop"
    assert list(tmp_path.iterdir()) == []


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
    ended = threading.Timer(0.2, lambda: signal.pthread_kill(main, signal.SIGTERM))
    main = threading.main_thread().ident
    ended.start()
    released = threading.Timer(0.4, bench.go.set)
    released.start()
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


def test_an_error_of_the_driver_is_the_same_with_a_watchdog(tmp_path: Path):
    with pytest.raises(TrialError, match="the environment failed: OSError: no route"):
        logged(Bench({7: OSError("no route")}), tmp_path, watchdog=10.0)


def test_the_thread_of_a_driver_ends_with_the_trial():
    with Watchdog(10.0, lambda: None) as watchdog:
        assert watchdog.call("a function", lambda: 5) == 5

    assert not watchdog.hangs
    assert "selfmodel driver" not in {thread.name for thread in threading.enumerate()}


@pytest.mark.parametrize("watchdog", [0.0, -1.0, float("nan"), float("inf")])
def test_a_watchdog_without_a_time_is_refused(watchdog: float):
    with pytest.raises(InputError, match="a watchdog needs a time of more than 0 s"):
        bench_robot(Bench(), watchdog=watchdog)


def test_a_watchdog_without_a_function_that_stops_the_robot_is_refused():
    with pytest.raises(InputError, match=r"and stop=, .* got 1.0 and no function"):
        EnvironmentRobot(Bench(), QUADRUPED, watchdog=1.0)
