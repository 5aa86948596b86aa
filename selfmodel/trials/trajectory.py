"""Trajectory: the recorded signals of one run, or of a batch of runs."""

import dataclasses
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from selfmodel.arrays import BoolArray, FloatArray, frozen
from selfmodel.errors import InputError, check_name, typed, unknown_name
from selfmodel.trials.signals import SIGNALS, Names, Signal

MAX_TIME_ERROR, MAX_LENGTH_ERROR = 0.5, 1e-3
"""Largest differences of the time of a row from its control step, control time steps; and of the
length of a quaternion from 1: float32 and printed digits round it."""


@dataclass(frozen=True)
class StepTiming:
    """Measured time of one control step, for a robot with its own clock.

    Attributes:
        elapsed: Seconds since the first observation by the robot's clock; NaN if unknown.
        late: Whether the time since the previous step differs from the control time step by more
            than a tolerance, in either direction.
        missing: Whether the step has no observation.
    """

    elapsed: float
    late: bool
    missing: bool


@dataclass(frozen=True)
class Sample:
    """State, readings and commands of one control step.

    Attributes:
        time: Scheduled time, s since the start of the run: a multiple of the control time step.
        values: Row of each signal, ``(width,)``, in the signal's unit.
        moment: Measured time of the step, for a robot with its own clock.
    """

    time: float
    values: Mapping[Signal, FloatArray]
    moment: StepTiming | None = None


class NotRecordedError(InputError):
    """A signal that a trajectory does not have; the message lists those that it has."""


@typed
@dataclass(frozen=True, eq=False)
class Trajectory:
    """The signals of one run or of a batch of runs.

    Row k is the state in which command k was computed, so the last command has no consequence in
    the record. A batch has a leading axis of runs.

    Example:
        >>> import selfmodel
        >>> trajectory = selfmodel.read_log("before.mcap").trial.trajectory
        >>> trajectory["base_position"].shape
        (60, 3)

    Attributes:
        names: Column names of the signals.
        time: Seconds since the start of the run, ``(steps,)``, strictly increasing.
        signals: Recorded signals, each ``(..., steps, width)``.
        late: Mask of the late steps, ``(steps,)``: the time since the previous row differs from the
            control time step; None for a robot without its own clock.
        substeps: Physics steps of the robot's model per control step, by which positions are
            integrated; the default is that of the paper's robots.
        welded: Mask of the hinges that the hypothesis of each run welds, ``(runs, hinges)``, of a
            prediction of segments.
        detached: Mask of the hinges of detached limbs, likewise.

    Raises:
        ValueError: A shape is inconsistent with the names, or time does not increase.
    """

    names: Names
    time: FloatArray
    signals: Mapping[Signal, FloatArray]
    late: BoolArray | None = None
    substeps: int = 2
    welded: BoolArray | None = None
    detached: BoolArray | None = None

    def __post_init__(self) -> None:
        if self.time.ndim != 1 or not np.all(np.diff(self.time) > 0):
            raise ValueError(
                f"time must be (steps,) and strictly increasing, got shape {self.time.shape}"
            )
        if self.late is not None and self.late.shape != self.time.shape:
            raise ValueError(f"late must be (steps,) = {self.time.shape}, got {self.late.shape}")
        for signal, values in self.signals.items():
            expected = (len(self.time), self.names.width(signal))
            if values.shape[-2:] != expected:
                raise ValueError(
                    f"{signal} must have shape (..., steps, width) = (..., {expected[0]}, "
                    f"{expected[1]}), got {values.shape}"
                )
        object.__setattr__(self, "signals", MappingProxyType(dict(self.signals)))

    def __getitem__(self, signal: Signal) -> FloatArray:
        """Returns one signal, ``(..., steps, width)``, or raises ``NotRecordedError``."""
        if signal not in self.signals:
            raise NotRecordedError(str(unknown_name("recorded signal", signal, self.signals)))
        return self.signals[signal]

    def hinge_mask(self, effect: Literal["welded", "detached"]) -> BoolArray:
        """Returns ``welded`` or ``detached`` of a batch of runs, ``(runs, hinges)``."""
        mask: BoolArray | None = getattr(self, effect)
        runs = len(next(iter(self.signals.values())))
        return np.zeros((runs, len(self.names.hinges)), np.bool_) if mask is None else mask

    @property
    def steady_commands(self) -> FloatArray:
        """Commands, with NaN for each that was held for other than one control time step."""
        commands = self["commands"]
        if self.late is None:
            return commands
        until_late = np.append(self.late[1:], False)  # no row follows the last command
        return np.where(until_late[:, np.newaxis], np.nan, commands)

    def __repr__(self) -> str:
        runs = next((values.shape[:-2] for values in self.signals.values()), ())
        batch = f"{'x'.join(map(str, runs))} runs of " if runs else ""
        widths = ", ".join(f"{name} ({self.names.width(name)})" for name in self.signals)
        late = "" if self.late is None else f"\n  late steps: {int(self.late.sum())}"
        end = float(self.time[-1]) if self.steps else 0.0
        return (
            f"<Trajectory: {batch}{self.steps} steps to {end:g} s"
            f"\n  signals (width): {widths or 'none'}{late}>"
        )

    @property
    def steps(self) -> int:
        """Number of recorded control steps."""
        return len(self.time)

    @property
    def timestep(self) -> float:
        """Mean duration of a control step, s, of at least two."""
        return float(self.time[-1] - self.time[0]) / (self.steps - 1)

    def with_signals(self, signals: Mapping[Signal, FloatArray]) -> "Trajectory":
        """Returns the trajectory with other, or further, signals."""
        return dataclasses.replace(self, signals={**self.signals, **signals})

    def run(self, number: int) -> "Trajectory":
        """Returns one of the runs of a batch, as a log has it: which hinges are fixed is not."""
        signals = {signal: values[number] for signal, values in self.signals.items()}
        return Trajectory(self.names, self.time, signals)

    def first(self, steps: int) -> "Trajectory":
        """Returns the trajectory of the first ``steps`` steps, at most all."""
        return self.rows(slice(steps))

    def rows(self, chosen: slice | BoolArray) -> "Trajectory":
        """Returns the trajectory of some steps, given by a slice or a mask, ``(steps,)``."""
        return dataclasses.replace(
            self,
            time=self.time[chosen],
            signals={name: values[..., chosen, :] for name, values in self.signals.items()},
            late=None if self.late is None else self.late[chosen],
        )


def samples_of(trajectory: Trajectory) -> Iterator[Sample]:
    """Yields the samples of the trajectory of one run; of their timing, they have what is late."""
    moments: Sequence[StepTiming | None] = [None] * trajectory.steps
    if trajectory.late is not None:
        moments = [StepTiming(np.nan, late, missing=False) for late in trajectory.late.tolist()]
    for k, (time, moment) in enumerate(zip(trajectory.time.tolist(), moments, strict=True)):
        values = {signal: rows[k] for signal, rows in trajectory.signals.items()}
        yield Sample(time, values, moment)


def collect(names: Names, samples: Iterable[Sample]) -> Trajectory:
    """Returns the trajectory of a sequence of samples.

    Raises:
        ValueError: There are no samples, or a row is inconsistent with ``names``.
    """
    rows = list(samples)
    if not rows:
        raise ValueError("a trajectory needs at least one sample, got none")
    time = frozen(np.array([row.time for row in rows]))
    late = [row.moment.late for row in rows if row.moment is not None]
    signals = {
        signal: frozen(np.stack([row.values[signal] for row in rows])) for signal in rows[0].values
    }
    return Trajectory(names, time, signals, np.array(late) if late else None)


@typed
def forward_displacement(trajectory: Trajectory) -> FloatArray:
    """Returns the forward displacement d(T) - d(1) along the world's x axis, m, of each run.

    Source: the paper, section III (fitness of the repair EA).
    """
    x = trajectory["base_position"][..., 0]
    with np.errstate(invalid="ignore"):  # a log may contain infinity: the displacement is NaN
        return np.asarray(x[..., -1] - x[..., 0])


class Described(Protocol):
    """Robot of a trial; ``selfmodel.Robot`` is one."""

    @property
    def name(self) -> str:
        """Name of the robot."""

    @property
    def control_timestep(self) -> float:
        """Duration of a control step, s."""

    @property
    def anatomy(self) -> Any:  # noqa: ANN401  # its class belongs to the robots
        """Parts of the robot, whose ``names`` are those of the columns."""


def trajectory_of_arrays(
    robot: Described,
    arrays: Mapping[Signal, ArrayLike | None],
    time: ArrayLike | None,
    orders: Mapping[Signal, Sequence[str] | None],
) -> Trajectory:
    """Returns the trajectory of measured arrays; missing signals are NaN.

    Without times, ``(steps,)`` s, the rows are at every control step. The orders are the names of
    the columns of an array, where they are not in the robot's order.

    Raises:
        InputError: An array has another shape, infinite numbers or quaternions that are not of unit
            length, the rows are not control steps, or a name is unknown, missing or listed twice.
    """
    if isinstance(robot, str):
        raise InputError(
            f"expected a robot, got its name {robot!r}: use selfmodel.load_robot({robot!r})"
        )
    names: Names = robot.anatomy.names
    given = {
        signal: _numbers(signal, values) for signal, values in arrays.items() if values is not None
    }
    steps = max((len(values) for values in given.values() if values.ndim), default=0)
    if steps < 2:
        raise InputError("a trial needs at least two rows of joint_positions and of commands")
    signals = {signal: np.full((steps, names.width(signal)), np.nan) for signal in SIGNALS}
    for signal, values in given.items():
        signals[signal] = _checked(values, signal, steps, names.columns(signal), orders.get(signal))
    lengths = np.linalg.norm(signals["base_orientation"], axis=1)
    wrong = np.flatnonzero(np.abs(lengths - 1) > MAX_LENGTH_ERROR)
    if len(wrong):
        raise InputError(
            f"base_orientation must have unit quaternions, w x y z, got one of length "
            f"{lengths[wrong[0]]:g} in row {wrong[0]}: normalise it, or set it to NaN"
        )
    scheduled = np.arange(steps, dtype=np.float64) * robot.control_timestep
    if time is not None:
        _check_time(_numbers("time", time), scheduled, robot.control_timestep)
    frozen_signals = {signal: frozen(values) for signal, values in signals.items()}
    return Trajectory(names, frozen(scheduled), frozen_signals)


def _numbers(signal: str, values: ArrayLike) -> FloatArray:
    try:
        return np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"{signal} must be an array of numbers, got {type(values).__name__}: {error}"
        ) from error


def _checked(
    values: FloatArray,
    signal: Signal,
    steps: int,
    known: tuple[str, ...],
    order: Sequence[str] | None,
) -> FloatArray:
    """Returns an array whose shape and numbers are right, with its columns in the robot's order."""
    kinds = {"sensors": "sensors", "commands": "motors"}
    kind = kinds.get(signal, "hinges" if signal.startswith("joint_") else "numbers")
    if values.shape != (steps, len(known)):
        raise InputError(
            f"{signal} must have the shape (steps, {kind}) = ({steps}, {len(known)}), "
            f"got {values.shape}: its columns are {', '.join(known)}"
        )
    infinite = np.argwhere(np.isinf(values)).tolist()
    if infinite:
        raise InputError(
            f"{signal} has an infinite number in row {infinite[0][0]}, column {infinite[0][1]}: "
            f"set what was not measured to NaN"
        )
    if order is None:
        return values
    for name in order:
        check_name(f"column of {signal}", name, known)
    if sorted(order) != sorted(known):
        raise InputError(
            f"the names of the columns of {signal} must be each of {', '.join(known)} once, got "
            f"{', '.join(order)}: correct the list"
        )
    return values[:, [list(order).index(name) for name in known]]


def _check_time(time: FloatArray, scheduled: FloatArray, timestep: float) -> None:
    steps = len(scheduled)
    if time.shape != (steps,):
        raise InputError(f"time must have the shape (steps,) = ({steps},), got {time.shape}")
    wrong = np.flatnonzero(~(np.abs(time - time[0] - scheduled) <= MAX_TIME_ERROR * timestep))
    if len(wrong):
        k = int(wrong[0])
        raise InputError(
            f"the rows must be one control time step apart, {timestep:g} s, and row {k} is "
            f"{time[k] - time[0]:g} s after row 0, not {scheduled[k]:g} s: load the robot with "
            f"the time step of the rows, resample them, or import a file of them with `selfmodel "
            f"logs import`, which resamples"
        )


TIME = "time"
"""Name of the time column, s."""

PREFIXES: Mapping[Signal, str] = MappingProxyType(
    {
        "joint_positions": "position",
        "joint_velocities": "velocity",
        "joint_efforts": "effort",
        "commands": "command",
        "sensors": "sensor",
        **{signal: signal for signal in SIGNALS if signal.startswith("base_")},
    }
)
"""First part of the name of each signal's columns: ``position.front_left_knee``."""


def column_names(names: Names, signal: Signal) -> tuple[str, ...]:
    """Returns the names of a signal's columns in a table."""
    return tuple(f"{PREFIXES[signal]}.{name}" for name in names.columns(signal))


def columns_of(trajectory: Trajectory) -> dict[str, FloatArray]:
    """Returns the columns of a trajectory by name, time first.

    A joint, motor or sensor without any number has no column, and so the base's vectors.
    """
    found: dict[str, FloatArray] = {TIME: trajectory.time}
    for signal in (name for name in PREFIXES if name in trajectory.signals):
        values, names = trajectory[signal], column_names(trajectory.names, signal)
        known = np.asarray(~np.isnan(values).all(axis=0))
        if signal.startswith("base_"):
            known[:] = known.any()
        found |= {name: values[:, k] for k, name in enumerate(names) if known[k]}
    return found
