"""When and how a robot is stopped: limits, cleanup, a watchdog of its driver."""

import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import Any, Self

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.errors import TrialError, WorkError, describe
from selfmodel.robot.robot import Robot
from selfmodel.trials.signals import Signal

NORM_TOLERANCE = 0.01
"""Largest deviation of a measured quaternion's norm from 1."""


@dataclass(frozen=True)
class Limit:
    """Safety limit: a condition under which a robot is stopped.

    Attributes:
        signals: Required signals; a robot that does not observe them is stopped too.
        reason: Returns the reason to stop the robot, or "" if no limit is exceeded. The argument
            is the row of each signal, ``(width,)``, NaN where not observed.
    """

    signals: tuple[Signal, ...]
    reason: Callable[[Mapping[Signal, FloatArray]], str]


def joint_limits(robot: Robot, margin: float) -> Limit:
    """Returns a limit on the joint positions: the ranges of the robot's model plus a margin.

    Args:
        robot: The robot; a hinge without a range has no limit.
        margin: Allowed distance beyond the range, rad; m for a slide joint.
    """
    names = robot.anatomy.hinges
    hinges = [robot.model.joint(name) for name in names]
    ranges = np.array(
        [hinge.range if hinge.limited[0] else (-np.inf, np.inf) for hinge in hinges]
    ).reshape(-1, 2)
    lowest, highest = ranges[:, 0] - margin, ranges[:, 1] + margin

    def reason(observed: Mapping[Signal, FloatArray]) -> str:
        angles = observed["joint_positions"]
        beyond = np.flatnonzero((angles < lowest) | (angles > highest))
        if not len(beyond):
            return ""
        k = int(beyond[0])
        return (
            f"{names[k]} is at {angles[k]:.3f}, beyond its range of {ranges[k, 0]:.3f} to "
            f"{ranges[k, 1]:.3f} and the margin of {margin:g}"
        )

    return Limit(("joint_positions",), reason)


def tilt_limit(max_tilt: float) -> Limit:
    """Returns a limit on the tilt of the base.

    Args:
        max_tilt: Largest angle between the z axes of the base and the world, rad.
    """

    def reason(observed: Mapping[Signal, FloatArray]) -> str:
        _, x, y, _ = orientation = observed["base_orientation"]
        norm = float(np.linalg.norm(orientation))
        if abs(norm - 1) > NORM_TOLERANCE:
            return f"base_orientation must be a unit quaternion, got the norm {norm:.2f}"
        tilt = float(np.arccos(np.clip(1 - 2 * (x * x + y * y), -1, 1)))
        if tilt > max_tilt:  # False for NaN: the orientation was not observed
            return f"the base is tilted by {tilt:.2f} rad, more than {max_tilt:g} rad"
        return ""

    return Limit(("base_orientation",), reason)


@contextmanager
def cleanup(action: Callable[[], object]) -> Iterator[None]:
    """Context manager that runs an action at the end of its block.

    An exception of the block, such as Ctrl-C, is raised in any case: a failure of the action is
    added to it as a note. After a block without an exception, or in a closed generator, a failure
    of the action is raised itself. ``contextlib.ExitStack`` would replace the exception of the
    block by the failure of the action.

    Args:
        action: The action; it may raise ``OSError`` or ``WorkError``.
    """
    try:
        yield
    except GeneratorExit:
        action()
        raise
    except BaseException as reason:
        try:
            action()
        except (OSError, WorkError) as failure:
            reason.add_note(describe(failure))
        raise
    action()


class HangError(TrialError):
    """A driver that did not return in time."""


class Watchdog:
    """Context manager with a thread that calls a driver; each call returns in time, or raises.

    A call of Python code cannot be ended from outside. So the thread that may hang is the driver's,
    and the thread that runs the trial sends the safe command, closes the log and ends the program.

    After a call that did not return, because of the time limit or of a signal, the end of the block
    makes the thread send the safe command once more as soon as the call returns: the driver may
    have sent targets after the first safe command. The end of the block waits for that for at most
    ``seconds``; the thread waits longer, until the process ends.

    Args:
        seconds: Time limit of a call, s.
        send_safe: Sends the safe command.
    """

    def __init__(self, seconds: float, send_safe: Callable[[], object]) -> None:
        self._seconds, self._send_safe = seconds, send_safe
        self._calls: SimpleQueue[Callable[[], Any] | None] = SimpleQueue()
        self._outcomes: SimpleQueue[tuple[Any, BaseException | None]] = SimpleQueue()
        self._thread = threading.Thread(target=self._serve, name="selfmodel driver", daemon=True)
        self._waiting = False

    @property
    def hangs(self) -> bool:
        """Whether a call has not returned."""
        return self._waiting and self._thread.is_alive()

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def call(self, what: str, function: Callable[[], Any]) -> Any:  # noqa: ANN401  # any function
        """Calls a function in the driver's thread; returns its result, or raises its exception.

        Args:
            what: Name of the function in the error message.
            function: The function.

        Raises:
            HangError: The function did not return in time.
        """
        self._waiting = True
        self._calls.put(function)
        try:
            result, error = self._outcomes.get(timeout=self._seconds)
        except Empty:
            raise HangError(
                f"the driver did not return from {what} within {self._seconds:g} s"
            ) from None
        self._waiting = False
        if error is not None:
            raise error
        return result

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._waiting:
            self._calls.put(self._send_safe)
        self._calls.put(None)
        self._thread.join(self._seconds)
        if self.hangs and error is not None:
            error.add_note(f"nor within another {self._seconds:g} s, after the safe command")

    def _serve(self) -> None:
        while (function := self._calls.get()) is not None:
            try:
                self._outcomes.put((function(), None))
            except BaseException as failure:  # noqa: BLE001  # `call` raises it in the caller's thread
                self._outcomes.put((None, failure))
