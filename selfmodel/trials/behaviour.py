"""What a run of a robot looked like: the record that simulation, logs and comparators share."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal, get_args

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, frozen

Signal = Literal[
    "sensors",
    "commands",
    "joint_positions",
    "joint_velocities",
    "joint_efforts",
    "base_position",
    "base_orientation",
    "base_linear_velocity",
    "base_angular_velocity",
]

SIGNALS: tuple[Signal, ...] = get_args(Signal)
"""Every signal of a run, in the order in which a log lists them.

``sensors``: what the controller received (touch 0 or 1, angles scaled to the joint's range).
``commands``: what goes into the motors, each in its own unit: a position servo's target, rad.
``joint_positions``: rad. ``joint_velocities``: rad/s.
``joint_efforts``: torque at the joint over the last physics step, N m; 0 at the start.
``base_position``: root body, world frame, m. ``base_orientation``: unit quaternion, w x y z.
``base_linear_velocity``: world frame, m/s. ``base_angular_velocity``: body frame, rad/s.
"""


@dataclass(frozen=True)
class Names:
    """The names that the columns of a behaviour's signals carry.

    Attributes:
        sensors: What feeds the controller, in its order.
        motors: What the controller commands, in its order.
        hinges: The single-degree joints of the model, in its order.
    """

    sensors: tuple[str, ...]
    motors: tuple[str, ...]
    hinges: tuple[str, ...]

    def width(self, signal: Signal) -> int:
        """Returns how many columns ``signal`` has."""
        return len(self.columns(signal))

    def columns(self, signal: Signal) -> tuple[str, ...]:
        """Returns the name of each column of ``signal``."""
        return {
            "sensors": self.sensors,
            "commands": self.motors,
            "joint_positions": self.hinges,
            "joint_velocities": self.hinges,
            "joint_efforts": self.hinges,
            "base_orientation": ("w", "x", "y", "z"),
        }.get(signal, ("x", "y", "z"))


@dataclass(frozen=True)
class StepTiming:
    """When a control step of a robot with a clock of its own really happened.

    Attributes:
        elapsed: Seconds from the first observation to this one by the robot's clock; NaN where it
            did not say.
        late: Whether it came more than a tolerance later than a control time step after the one
            before, or, as where a driver catches up, sooner.
        missing: Whether nothing was observed.
    """

    elapsed: float
    late: bool
    missing: bool


@dataclass(frozen=True)
class Sample:
    """One control step of a run, as it happened: the state, what was read, what was commanded.

    Attributes:
        time: Seconds since the start of the run, when the sensors were to be read: a multiple of
            the control time step.
        values: Each signal's row at that moment, ``(width,)``.
        moment: When that really was, where the robot has a clock of its own.
    """

    time: float
    values: Mapping[Signal, FloatArray]
    moment: StepTiming | None = None


@dataclass(frozen=True, eq=False)
class Behaviour:
    """The signals of one run, or of a batch of runs.

    Row k is the state in which command k was computed, so the last command has no consequence in
    the record. A batch has a leading axis of runs.

    Attributes:
        names: What the columns are called.
        time: ``(steps,)`` seconds since the start of the run, strictly increasing.
        signals: What was recorded, each ``(..., steps, width)``.
        late: ``(steps,)``: whether other than a control time step lies between a row and the one
            before, as on a robot with a clock of its own; None where that is never so.

    Raises:
        ValueError: A shape does not fit its names, or time does not increase.
    """

    names: Names
    time: FloatArray
    signals: Mapping[Signal, FloatArray]
    late: BoolArray | None = None

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
        """Returns one signal, ``(..., steps, width)``.

        Raises:
            KeyError: It was not recorded; a comparator asks for what it needs by ``needs``.
        """
        try:
            return self.signals[signal]
        except KeyError:
            recorded = ", ".join(self.signals) or "nothing"
            raise KeyError(f"{signal} was not recorded; recorded: {recorded}") from None

    @property
    def steady_commands(self) -> FloatArray:
        """The commands, with NaN for each that stood for other than a control time step.

        What was commanded then is known; what it led to is at another time than a row says.
        """
        commands = self["commands"]
        if self.late is None:
            return commands
        until_late = np.append(self.late[1:], False)  # the last leads nowhere
        return np.where(until_late[:, np.newaxis], np.nan, commands)

    @property
    def steps(self) -> int:
        """How many control steps were recorded."""
        return len(self.time)

    def first(self, steps: int) -> "Behaviour":
        """Returns the first steps of it, or all of it if it has no more."""
        return Behaviour(
            names=self.names,
            time=self.time[:steps],
            signals={name: values[..., :steps, :] for name, values in self.signals.items()},
            late=None if self.late is None else self.late[:steps],
        )


def collect(names: Names, samples: Iterable[Sample]) -> Behaviour:
    """Returns the behaviour that ``samples`` make up, for a run that needs no log.

    Raises:
        ValueError: There are no samples, or their rows do not fit ``names``.
    """
    rows = list(samples)
    if not rows:
        raise ValueError("a behaviour needs at least one sample, got none")
    return Behaviour(
        names=names,
        time=frozen(np.array([row.time for row in rows])),
        signals={
            signal: frozen(np.stack([row.values[signal] for row in rows]))
            for signal in rows[0].values
        },
        late=late_steps([row.moment for row in rows]),
    )


def late_steps(moments: Sequence[StepTiming | None]) -> BoolArray | None:
    """Returns which steps were late, ``(steps,)``; None for a robot without a clock of its own."""
    known = [moment for moment in moments if moment is not None]
    return np.array([moment.late for moment in known]) if known else None


def forward_displacement(behaviour: Behaviour) -> FloatArray:
    """Returns d(T) - d(1), how far the root body travelled along the world's x axis.

    Source: the paper, section III (fitness of the repair EA).

    Returns:
        Metres, one number a run: shape ``(...)``, ``()`` for a single run.
    """
    x = behaviour["base_position"][..., 0]
    return np.asarray(x[..., -1] - x[..., 0])
