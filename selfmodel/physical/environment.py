"""Physical robot behind a ``dm_env.Environment``, such as real hardware."""

import math
import time
from collections.abc import (
    Callable,
    Collection,
    Generator,
    Iterable,
    Iterator,
    Mapping,
    Sequence,
)
from contextlib import contextmanager, suppress
from dataclasses import KW_ONLY, dataclass, field
from functools import partial
from numbers import Integral, Real
from typing import Any

import dm_env
import numpy as np
from numpy.typing import ArrayLike

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.controllers.controller import TASK_PREFIX, CommandSource, make_batch
from selfmodel.controllers.playback import Playback
from selfmodel.errors import (
    InputError,
    TrialError,
    check_function,
    check_name,
    check_type,
    items_of,
    real_number,
    whole_number,
)
from selfmodel.physical.interface import NORM_TOLERANCE, Limit
from selfmodel.physical.safety import (
    HangError,
    HeldIterator,
    Watchdog,
    cleanup,
    release_stop_signals,
)
from selfmodel.robot.actuators import command_ranges
from selfmodel.robot.robot import Robot
from selfmodel.trials.signals import SIGNALS, Names, Signal
from selfmodel.trials.trajectory import Sample, StepTiming

Policy = Callable[[Any], ArrayLike]
"""Function from an observation of an environment, as it is, to its action, the motor targets."""

Observe = Callable[[Any], Mapping[str, Any] | None]
"""Function from an observation of the environment to signals by name, each ``(width,)``, with an
optional ``time``. Absent signals and NaN count as not observed; None if there is no observation."""

TIMESTAMP = "time"
"""Optional key of an observation, beside the signals: its time by the robot's clock, s."""

Call = Callable[[str, Callable[[], Any]], Any]
"""Function that calls a named function of the driver, and returns its result."""


def signals_by_name(
    observation: Any,  # noqa: ANN401  # dm_env leaves the type of observations open
) -> Mapping[str, Any] | None:
    """Returns the items of an observation that have the name of a signal.

    Raises:
        InputError: The observation is not a mapping, or has no signal.
    """
    if observation is None:
        return None
    if not isinstance(observation, Mapping):
        raise InputError(
            f"expected an observation that is a mapping by name, got a "
            f"{type(observation).__name__}: give observe=, a function to such a mapping"
        )
    signals = {
        name: value
        for name, value in observation.items()
        if name in (*SIGNALS, TIMESTAMP) or str(name).startswith(TASK_PREFIX)
    }
    if not signals:
        raise InputError(
            f"expected an observation with some of {', '.join(SIGNALS)}, got one of "
            f"{', '.join(map(str, observation)) or 'nothing'}: give observe=, a function that "
            f"renames them"
        )
    return signals


@dataclass(eq=False, repr=False)
class EnvironmentRobot:
    """Physical robot that is stepped through an environment; see ``PhysicalRobot``.

    ``reset`` must move the robot to its initial pose, at rest. ``step`` must send the targets to
    the motors at once, return after one control time step, and return the observation of that time.
    The environment sets the duration of a step; ``EnvironmentRobot`` measures the duration.

    If no observation arrives in time, ``step`` returns the observation None or raises
    ``TimeoutError``. The controller then runs on its previous readings.

    The safe command is sent before ``reset`` and at the end. It is the first action after an early
    end of a trial: an exception in the environment, an exceeded limit, missing observations,
    a caller that stops iterating, or a signal: Ctrl-C, and within ``handle_stop_signals``, as in
    ``run_trial`` and ``recover``, SIGTERM and SIGHUP. A signal does not interrupt the safe command.

    Attributes:
        env: The environment. Its actions are the motor targets, in the order of the model's motors.
        robot: The robot as its model describes it.
        observe: Converts an observation to signals.
        policy: Function of an observation, as it is, to the motor targets, ``(motors,)``, which
            drives the robot in place of a trial's controller: give a ``Playback`` as that, whose
            commands are then those of the policy in the log.
        signals: Signals that its observations have. By default, without ``observe``, those in
            ``env.observation_spec()``; if none is known, all are taken to be observed.
        stop: Stops the robot safely, at any time and repeatedly. The default is ``env.step(safe)``.
            Before ``reset`` and after the last step of an episode, a ``dm_env`` environment ignores
            the targets and resets, so the robot then moves to its initial pose.
        safe: Safe motor targets, ``(motors,)``; by default 0, clipped to the range of each motor.
        limits: Safety limits, such as ``joint_limits`` and ``tilt_limit``. Their signals are
            required, as the controller's readings are.
        critical: Signals that must not be NaN in an observation that arrived.
        patience: Consecutive steps for which a required signal may be missing.
        watchdog: Time limit of each ``reset`` and ``step``, s, after which the trial ends and the
            safe command is sent although the driver has not returned. It is sent once more when the
            driver returns. The trial waits for that for at most the same time. With a watchdog, a
            thread of its own calls the driver, and ``stop`` is called from another thread while a
            step hangs; so ``stop`` is required. None, the default, is no limit: the driver is
            called from the thread of the trial.
        tolerance: Largest deviation of a punctual step, as a fraction of the control time step.
        silent_neurons: Indices of the silent hidden neurons of the controller.
        clock: Monotonic clock, s. Timestamps of observations, as ``time``, take precedence.

    Raises:
        InputError: The number of actions of the environment, or of safe targets, is not the number
            of motors, or a watchdog has no ``stop`` or no positive time.
    """

    env: dm_env.Environment
    robot: Robot
    _: KW_ONLY
    observe: Observe = signals_by_name
    policy: Policy | None = None
    signals: Collection[Signal] = ()
    stop: Callable[[], object] | None = None
    safe: FloatArray | None = None
    limits: Sequence[Limit] = ()
    critical: Sequence[Signal] = ()
    patience: int = 5
    watchdog: float | None = None
    tolerance: float = 0.25
    silent_neurons: Iterable[int] = ()
    clock: Callable[[], float] = time.monotonic
    _dog: Watchdog | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        check_type(self.robot, Robot, 'a Robot, such as selfmodel.load_robot("quadruped")')
        if not hasattr(self.env, "action_spec"):
            raise InputError(
                f"expected a dm_env.Environment that drives the robot, got {self.env!r:.80}"
            )
        check_function("observe", self.observe)
        if self.policy is not None:
            check_function("policy", self.policy)
        self.patience = whole_number("patience", self.patience, 5, least=0)
        self.tolerance = real_number("tolerance", self.tolerance, 0.25, 0.0, "real")
        self.signals, self.critical = _signals(self.signals), _signals(self.critical)
        if isinstance(self.silent_neurons, Integral):
            self.silent_neurons = (int(self.silent_neurons),)
        anatomy = self.robot.anatomy
        motors = (len(anatomy.motors),)
        if self.safe is None:
            centre, half = np.array(command_ranges(self.robot.model)).T
            targets = np.clip(0.0, centre - half, centre + half)
        else:
            targets = np.array(self.safe, dtype=np.float64)
        for what, shape in (
            ("the environment's actions", tuple(self.env.action_spec().shape)),
            ("the safe targets", targets.shape),
        ):
            if shape != motors:
                raise InputError(
                    f"{what} must be targets of the {motors[0]} motors of {self.robot.name} "
                    f"({', '.join(anatomy.motors)}), got the shape {shape}"
                )
        seconds = self.watchdog
        timed = isinstance(seconds, Real) and seconds is not True and 0 < seconds < math.inf
        if seconds is not None and not (self.stop and timed):
            raise InputError(
                f"a watchdog needs a time of more than 0 s, and stop=, a function that stops the "
                f"robot while the environment hangs; got {seconds!r} and "
                f"{'no function' if self.stop is None else 'a function'}"
            )
        named: Collection[Signal] = self.signals
        if not named and self.observe is signals_by_name:
            named = [signal for signal in SIGNALS if signal in self.env.observation_spec()]
        self.signals = {*named, "commands"} if named else SIGNALS
        self.silent_neurons = frozenset(self.silent_neurons)
        self._halt = self.stop or partial(_step_to, self.env, targets)

    def run(self, controller: CommandSource, steps: int) -> Iterator[Sample]:
        """Runs a controller; see ``PhysicalRobot``.

        The caller must close the returned iterator, as ``write_trial`` does: closing it stops the
        robot. Between two samples, only ``handle_stop_signals`` makes SIGTERM and SIGHUP an
        exception in the caller.

        Raises:
            TrialError: The environment failed, ended its episode or returned no observations, or a
                limit was exceeded. The robot was stopped, unless a note of the error reports a
                failed stop.
            InputError: The observations do not have the shapes of the robot's signals.
        """
        return HeldIterator(self._run(controller, steps))

    def _run(self, controller: CommandSource, steps: int) -> Generator[Sample, None, None]:
        # The safe command comes before the watchdog waits for a driver that hangs.
        with self._driver() as call, cleanup(self._make_safe):  # after programming errors too
            self._make_safe()
            yield from self._steps(call, controller, steps)

    @contextmanager
    def _driver(self) -> Iterator[Call]:
        """Yields a function that calls the driver, with or without a time limit.

        Raises:
            TrialError: The driver still hangs in a call of an earlier trial.
        """
        if self.watchdog is None:
            yield lambda _, function: function()
            return
        if self._dog is not None and self._dog.hangs:
            raise TrialError("the driver has not returned from a call of an earlier trial")
        with Watchdog(self.watchdog, self._send_safe) as self._dog:
            yield self._dog.call

    def _make_safe(self) -> None:
        try:
            self._send_safe()
        except (KeyboardInterrupt, SystemExit):
            # From the caller's own handler of a signal: it must not prevent the safe command.
            with cleanup(self._send_safe):
                raise

    def _send_safe(self) -> None:
        try:
            self._halt()
        except Exception as error:  # a driver may raise any exception: raised as a TrialError
            raise TrialError(
                f"the safe command could not be sent: {_type_and_message(error)}"
            ) from error

    def _steps(self, call: Call, controller: CommandSource, steps: int) -> Iterator[Sample]:
        robot = self.robot
        names, timestep = robot.anatomy.names, robot.control_timestep
        controllers = make_batch([controller], [frozenset(self.silent_neurons)], len(names.sensors))
        commands = np.zeros((1, len(names.motors)))
        # The readings are required of a controller; of a playback, only that some signal arrives.
        needed = {signal for limit in self.limits for signal in limit.signals}
        reads = not isinstance(controller, Playback) and controller.design.reads
        needed |= {"sensors"} if reads else set()
        needed |= {signal for signal in SIGNALS if signal in controllers.observed}
        missing_steps: dict[Signal, IndexArray] = {
            signal: np.zeros(names.width(signal), dtype=np.intp)
            for signal in SIGNALS
            if signal in {*needed, "sensors"}
        }
        timer = StepTimer(timestep, self.tolerance)
        ended = False
        for k in range(steps):
            if ended:
                raise TrialError(
                    f"the environment ended its episode after {k} of {steps} steps: give it a "
                    f"longer time limit, or the trial fewer steps"
                )
            result = self._step_environment(call, commands[0] if k else None)
            ended = result is not None and result.last()
            observation = self.observe(result.observation) if result is not None else None
            expected = "a mapping of signals by name, or None, from observe"
            check_type(observation, Mapping | None, expected)
            timing = timer.update(self.clock(), observation)
            values = _rows(names, {} if timing.missing or observation is None else observation)
            for signal, counts in missing_steps.items():
                missing = np.isnan(values[signal]) & (signal in needed or timing.missing)
                missing_steps[signal] = np.where(missing, counts + 1, 0)
                self._check_patience(k, signal, missing_steps[signal])
            self._check(k, values, missing=timing.missing)
            readings = values["sensors"]
            np.copyto(controllers.readings[0], readings, where=~np.isnan(readings))
            for signal in SIGNALS:
                if signal in controllers.observed:
                    value = values[signal]
                    norm = np.linalg.norm(value)
                    if signal == "base_orientation" and abs(norm - 1) > NORM_TOLERANCE:
                        raise TrialError(
                            f"base_orientation must be a unit quaternion, got {value.tolist()} at "
                            f"step {k}"
                        )
                    np.copyto(controllers.observed[signal][0], value, where=~np.isnan(value))
            if observation is not None:
                _read_task(controllers.observed, observation)
            controllers.step(commands)
            if self.policy is not None and result is not None and observation is not None:
                commands[0] = self._targets(k, self.policy, result.observation)
            if not np.isfinite(commands).all():  # of a network that divides by 0, for example
                raise TrialError(f"the controller's commands are not finite at step {k}")
            values["commands"] = commands[0].copy()
            yield Sample(k * timestep, values, timing)

    def _targets(self, step: int, policy: Policy, observation: object) -> FloatArray:
        """Returns the motor targets of a policy; ``InputError`` before the robot moves."""
        from selfmodel.controllers.function import called, name_of  # noqa: PLC0415  # few have one

        motors = self.robot.anatomy.motors
        try:
            return called(name_of(policy), policy, observation, (len(motors),), finite=True)
        except TrialError as error:
            if step:
                raise
            raise InputError(f"{error}; the motors are {', '.join(motors)}") from error

    def _step_environment(self, call: Call, targets: FloatArray | None) -> dm_env.TimeStep | None:
        """Returns the result of a step, or of a reset without targets; None after a timeout."""
        try:
            with release_stop_signals():
                if targets is None:
                    return call("reset", self.env.reset)
                return call("step", partial(self.env.step, targets.copy()))
        except TimeoutError:
            return None
        except HangError:
            raise
        except Exception as error:  # an environment may raise any: raised as a TrialError
            raise TrialError(f"the environment failed: {_type_and_message(error)}") from error

    def _check_patience(self, k: int, signal: Signal, missing_steps: IndexArray) -> None:
        """Raises ``TrialError`` if a column of a required signal is missing for too long."""
        patience = self.patience if k else 0  # at step 0 there are no previous readings
        columns = np.array(self.robot.anatomy.names.columns(signal))
        if lacking := ", ".join(columns[missing_steps > patience]):
            if signal != "sensors":
                limited = any(signal in limit.signals for limit in self.limits)
                who = "a limit" if limited else "the controller"
                lacking = f"{signal} ({lacking}), which {who} requires,"
            raise TrialError(f"no reading of {lacking} for more than {patience} steps, at step {k}")

    def _check(self, k: int, values: Mapping[Signal, FloatArray], *, missing: bool) -> None:
        for signal, row in values.items():
            if np.any(np.isinf(row)):
                raise TrialError(f"{signal} is infinite at step {k}")
            if signal in self.critical and not missing and np.any(np.isnan(row)):
                raise TrialError(f"{signal} is not a number at step {k}")
        for limit in self.limits:
            if reason := limit.reason(values):
                raise TrialError(f"a limit was exceeded at step {k}: {reason}")


def _read_task(observed: Mapping[str, FloatArray], observation: Mapping[str, Any]) -> None:
    """Writes the observation of a task into what a controller observes, if that is part of it."""
    for name in (one for one in observed if one.startswith(TASK_PREFIX)):
        shape, width = np.shape(observation.get(name, 0.0)), observed[name].shape[1]
        if shape != (width,):
            raise InputError(
                f"expected {width} numbers as {name} in an observation, which the controller "
                f"requires, got the shape {shape}: let observe= return them, or give a policy "
                f"without the term task"
            )
        observed[name][0] = observation[name]


def _signals(given: str | Collection[Signal]) -> tuple[Signal, ...]:
    """Returns signals, given as one or in a collection, or raises ``InputError``."""
    names = items_of(given)
    for name in names:
        check_name("signal", str(name), SIGNALS)
    return tuple(signal for signal in SIGNALS if signal in names)


def _step_to(env: dm_env.Environment, targets: FloatArray) -> None:
    with suppress(TimeoutError):  # the targets were sent; the observation is not used
        env.step(targets.copy())


def _rows(names: Names, observation: Mapping[str, Any]) -> dict[Signal, FloatArray]:
    """Returns the row of every signal but the commands, NaN where not observed.

    Raises:
        InputError: The shape of a signal is not ``(width,)``, or a value is no number.
    """
    rows: dict[Signal, FloatArray] = {}
    for signal in SIGNALS:
        if signal == "commands":
            continue
        width = names.width(signal)
        given = observation.get(signal)
        try:
            row = np.full(width, np.nan) if given is None else np.array(given, dtype=np.float64)
        except (ValueError, TypeError) as error:
            raise InputError(f"expected numbers of {signal} in an observation: {error}") from error
        if row.shape != (width,):
            raise InputError(
                f"expected {signal} of shape ({width},) in an observation, its columns being "
                f"{', '.join(names.columns(signal))}, got the shape {row.shape}"
            )
        rows[signal] = row
    return rows


def _type_and_message(error: Exception) -> str:
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__


class StepTimer:
    """Computes the timing of each control step, with the tolerance of ``EnvironmentRobot``.

    All times are timestamps of observations if the first has one, or else readings of the clock.
    """

    def __init__(self, timestep: float, tolerance: float) -> None:
        self._timestep, self._tolerance = timestep, tolerance
        self._origin = self._last_elapsed = math.nan
        self._steps_since_last = 0
        self._has_timestamps = False

    def update(self, now: float, observation: Mapping[str, Any] | None) -> StepTiming:
        """Returns the timing of the next step.

        An observation that is not newer than the previous observation is a repetition, and counts
        as missing. ``now`` is a reading of the clock, s.
        """
        timestamp = float("nan" if observation is None else observation.get(TIMESTAMP, "nan"))
        if math.isinf(timestamp):  # a log cannot contain an infinite time
            timestamp = math.nan
        if math.isnan(self._origin):
            self._has_timestamps = not math.isnan(timestamp)
            self._origin = timestamp if self._has_timestamps else now
        elapsed = (timestamp if self._has_timestamps else now) - self._origin
        self._steps_since_last += 1
        if math.isnan(elapsed) or (self._has_timestamps and elapsed <= self._last_elapsed):
            # The time of an observation without a timestamp is unknown.
            unknown = math.isnan(elapsed) and observation is not None
            return StepTiming(math.nan, late=unknown, missing=not unknown)
        deviation = abs(elapsed - self._last_elapsed - self._steps_since_last * self._timestep)
        self._last_elapsed, self._steps_since_last = elapsed, 0
        # The deviation of the first step is NaN, which is never late.
        return StepTiming(
            elapsed,
            late=deviation > self._tolerance * self._timestep,
            missing=observation is None,
        )
