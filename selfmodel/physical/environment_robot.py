"""A physical robot behind any ``dm_env.Environment``: how real hardware is driven."""

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import Any

import dm_env
import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.controllers.command_source import CommandSource, make_batch
from selfmodel.controllers.playback import Playback
from selfmodel.errors import InputError, TrialError
from selfmodel.physical.cleanup import Ending
from selfmodel.physical.safety_limits import Limit
from selfmodel.physical.step_timing import TIME, Stopwatch
from selfmodel.robot.actuator_ranges import command_ranges
from selfmodel.robot.robot import Robot
from selfmodel.trials.behaviour import SIGNALS, Names, Sample, Signal

Observe = Callable[[Any], Mapping[str, Any] | None]
"""Turns an observation into our signals, each ``(width,)``, and perhaps ``time``; what it leaves
out, and what is NaN, was not observed. None: nothing was."""


def by_name(observation: Any) -> Mapping[str, Any] | None:  # noqa: ANN401  # dm_env's is anything
    """Takes what an observation has under the names of our signals, and leaves the rest.

    Raises:
        InputError: It has no names, or none of ours.
    """
    if observation is None:
        return None
    if not isinstance(observation, Mapping):
        raise InputError(
            f"expected an observation that is a mapping by name, got a "
            f"{type(observation).__name__}: give observe=, which makes one of it"
        )
    ours = {name: observation[name] for name in (*SIGNALS, TIME) if name in observation}
    if not ours:
        raise InputError(
            f"expected an observation with some of {', '.join(SIGNALS)}, got one of "
            f"{', '.join(map(str, observation)) or 'nothing'}: give observe=, which renames them"
        )
    return ours


class EnvironmentRobot:
    """A physical robot that is stepped through an environment; see ``PhysicalRobot``.

    ``reset`` is to bring the robot to its start pose, at rest; ``step`` is to give the motors their
    targets at once, to return when a control time step has passed, and to bring what was observed
    then. What paces it is the environment's affair; what is measured here is what came of it.

    A ``step`` that observes nothing in time gives None as its observation, and may raise
    ``TimeoutError`` for it. The controller then goes on with the readings that it had.

    The safe command is sent before ``reset``, at the end, and before anything else when the trial
    ends early, whatever the reason: an exception in the environment, a limit, silence, Ctrl-C, or a
    caller that stops iterating.

    Args:
        env: What the robot is stepped through. Its actions are the motor targets, in the order of
            the model's motors.
        robot: The robot as its model describes it.
        observe: Turns an observation into our signals.
        stop: Brings the robot to rest, safely, at any time, and again if it is at rest. Without it,
            ``env.step(safe)`` does; before ``reset`` and after the last step of an episode, that
            is ``reset`` without targets, as ``dm_env`` has it, so the robot moves to its start.
        safe: The motor targets that are safe, ``(motors,)``; if not given, 0 or what is nearest to
            it that a motor can be commanded.
        limits: What the robot is stopped for; ``physical.safety_limits`` has some.
            The signals that they need are readings too.
        critical: Signals of which no number may be NaN in an observation that came.
        patience: Steps in a row for which a reading may be missing.
        tolerance: By how much of a control time step a step may be late.
        silent_neurons: Indices of the silent hidden neurons of the controller.
        clock: Tells the time, s; it never goes back. The environment's observations may tell it
            better, as ``time``.

    Raises:
        InputError: The environment's actions are not the robot's motors, or neither are the safe
            targets.
    """

    def __init__(
        self,
        env: dm_env.Environment,
        robot: Robot,
        *,
        observe: Observe = by_name,
        stop: Callable[[], object] | None = None,
        safe: FloatArray | None = None,
        limits: Sequence[Limit] = (),
        critical: Sequence[Signal] = (),
        patience: int = 5,
        tolerance: float = 0.25,
        silent_neurons: Iterable[int] = (),
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        motors = (len(robot.anatomy.motors),)
        targets = _nearest_to_zero(robot) if safe is None else np.array(safe, dtype=np.float64)
        for what, shape in (
            ("the environment's actions", tuple(env.action_spec().shape)),
            ("the safe targets", targets.shape),
        ):
            if shape != motors:
                raise InputError(
                    f"{what} must be the targets of the {motors[0]} motors of {robot.name} "
                    f"({', '.join(robot.anatomy.motors)}), got the shape {shape}"
                )
        self._env, self._robot, self._observe = env, robot, observe
        self._halt = stop or partial(_step_to, env, targets)
        self._limits, self._critical = tuple(limits), tuple(critical)
        self._patience, self._tolerance = patience, tolerance
        self._silent_neurons = frozenset(silent_neurons)
        self.clock = clock

    def run(self, controller: CommandSource, steps: int) -> Iterator[Sample]:
        """Runs a controller; see ``PhysicalRobot``.

        Close what this returns when done, as ``write_trial`` does: that stops the robot.

        Raises:
            TrialError: The environment failed, ended its episode or was silent, or a limit was
                exceeded; the robot was stopped, or the error's note says that it was not.
            InputError: The observations are not of this robot.
        """
        with Ending(self._make_safe):  # after Ctrl-C and bugs too: no robot goes on by itself
            self._make_safe()
            yield from self._steps(controller, steps)

    def _make_safe(self) -> None:
        try:
            self._send_safe()
        except KeyboardInterrupt:
            # A second Ctrl-C must not keep the first one's from the robot.
            with Ending(self._send_safe):
                raise

    def _send_safe(self) -> None:
        try:
            self._halt()
        except Exception as error:  # a driver is somebody else's, and may raise anything
            raise TrialError(f"the safe command could not be sent: {_told(error)}") from error

    def _steps(self, controller: CommandSource, steps: int) -> Iterator[Sample]:
        robot = self._robot
        names, timestep = robot.anatomy.names, robot.control_timestep
        brain = make_batch([controller], [self._silent_neurons], len(names.sensors))
        commands = np.zeros((1, len(names.motors)))
        needed = {signal for limit in self._limits for signal in limit.signals}
        if not isinstance(controller, Playback):
            needed.add("sensors")
        silent: dict[Signal, IndexArray] = {
            signal: np.zeros(names.width(signal), dtype=np.intp)
            for signal in SIGNALS
            if signal in needed or signal == "sensors"
        }
        on_event = Stopwatch(timestep, self._tolerance)
        ended = False
        for k in range(steps):
            if ended:
                raise TrialError(
                    f"the environment ended its episode after {k} of {steps} steps: give it a "
                    f"longer time limit, or the trial fewer steps"
                )
            seen = self._act(commands[0] if k else None)
            ended = seen is not None and seen.last()
            told = self._observe(seen.observation) if seen is not None else None
            moment = on_event.look(self.clock(), told)
            values = _rows(names, {} if moment.missing or told is None else told)
            for signal, counts in silent.items():
                unread = np.isnan(values[signal]) & (signal in needed or moment.missing)
                silent[signal] = np.where(unread, counts + 1, 0)
            self._check(k, values, silent, missing=moment.missing)
            readings = values["sensors"]
            np.copyto(brain.readings[0], readings, where=~np.isnan(readings))
            brain.step(commands)
            values["commands"] = commands[0].copy()
            yield Sample(k * timestep, values, moment)

    def _act(self, targets: FloatArray | None) -> dm_env.TimeStep | None:
        """Gives the motors their targets, or begins where there are none yet; None for silence."""
        try:
            return self._env.reset() if targets is None else self._env.step(targets.copy())
        except TimeoutError:
            return None
        except Exception as error:  # an environment is somebody else's, and may raise anything
            raise TrialError(f"the environment failed: {_told(error)}") from error

    def _check(
        self,
        k: int,
        values: Mapping[Signal, FloatArray],
        silent: Mapping[Signal, IndexArray],
        *,
        missing: bool,
    ) -> None:
        """Sees whether the robot can go on.

        Raises:
            TrialError: It cannot.
        """
        patience = self._patience if k else 0  # at first there is nothing to go on with
        for signal, counts in silent.items():
            columns = self._robot.anatomy.names.columns(signal)
            pairs = zip(columns, counts > patience, strict=True)
            if lacking := ", ".join(name for name, is_silent in pairs if is_silent):
                if signal != "sensors":
                    lacking = f"{signal} ({lacking}), which a limit needs,"
                raise TrialError(
                    f"nothing was read of {lacking} for more than {patience} steps, at step {k}"
                )
        for signal, row in values.items():
            if np.any(np.isinf(row)):
                raise TrialError(f"{signal} is infinite at step {k}")
            if signal in self._critical and not missing and np.any(np.isnan(row)):
                raise TrialError(f"{signal} is not a number at step {k}")
        for limit in self._limits:
            if reason := limit.reason(values):
                raise TrialError(f"a limit was exceeded at step {k}: {reason}")


def _step_to(env: dm_env.Environment, targets: FloatArray) -> None:
    with suppress(TimeoutError):  # they were sent, and nobody asks what is observed
        env.step(targets.copy())


def _nearest_to_zero(robot: Robot) -> FloatArray:
    centre, half = np.array(command_ranges(robot.model)).T
    return np.asarray(np.clip(0.0, centre - half, centre + half))


def _rows(names: Names, told: Mapping[str, Any]) -> dict[Signal, FloatArray]:
    """Every signal of an observation but the commands, NaN where it was not observed.

    Raises:
        InputError: A signal has another shape.
    """
    rows: dict[Signal, FloatArray] = {}
    for signal in SIGNALS:
        if signal == "commands":
            continue
        width = names.width(signal)
        given = told.get(signal)
        row = np.full(width, np.nan) if given is None else np.array(given, dtype=np.float64)
        if row.shape != (width,):
            raise InputError(
                f"expected {signal} of shape ({width},) in an observation, that is "
                f"{', '.join(names.columns(signal))}, got the shape {row.shape}"
            )
        rows[signal] = row
    return rows


def _told(error: Exception) -> str:
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
