"""Behaviour: the recorded signals of one run or a batch of runs (in the field: a trajectory)."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, frozen
from selfmodel.trials.signals import Names, Signal


@dataclass(frozen=True)
class StepTiming:
    """Measured time of one control step, for a robot with its own clock.

    Attributes:
        elapsed: Seconds from the first observation to this one by the robot's clock; NaN if
            unknown.
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
        time: Scheduled time of the step, s since the start of the run: a multiple of the control
            time step.
        values: Row of each signal, ``(width,)``, in the signal's unit.
        moment: Measured time of the step, for a robot with its own clock.
    """

    time: float
    values: Mapping[Signal, FloatArray]
    moment: StepTiming | None = None


@dataclass(frozen=True, eq=False)
class Behaviour:
    """The signals of one run or of a batch of runs.

    Row k is the state in which command k was computed, so the last command has no consequence in
    the record. A batch has a leading axis of runs.

    Example:
        >>> import selfmodel
        >>> behaviour = selfmodel.read_log("before.mcap").trial.behaviour
        >>> behaviour["base_position"].shape
        (60, 3)

    Attributes:
        names: Column names of the signals.
        time: Seconds since the start of the run, ``(steps,)``, strictly increasing.
        signals: Recorded signals, each ``(..., steps, width)``.
        late: Mask of the late steps, ``(steps,)``: the time since the previous row differs from the
            control time step; None for a robot without its own clock.

    Raises:
        ValueError: A shape is inconsistent with the names, or time does not increase.
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
            KeyError: The signal was not recorded.
        """
        try:
            return self.signals[signal]
        except KeyError:
            recorded = ", ".join(self.signals) or "nothing"
            raise KeyError(f"{signal} was not recorded; recorded: {recorded}") from None

    @property
    def steady_commands(self) -> FloatArray:
        """Commands, with NaN for each command that was held for other than one control time step.

        The value of such a command is known, but the next row is not one control time step later.
        """
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
            f"<Behaviour: {batch}{self.steps} steps to {end:g} s"
            f"\n  signals (width): {widths or 'none'}{late}>"
        )

    @property
    def steps(self) -> int:
        """Number of recorded control steps."""
        return len(self.time)

    def first(self, steps: int) -> "Behaviour":
        """Returns the behaviour of the first ``steps`` steps, at most all."""
        return Behaviour(
            names=self.names,
            time=self.time[:steps],
            signals={name: values[..., :steps, :] for name, values in self.signals.items()},
            late=None if self.late is None else self.late[:steps],
        )


def samples_of(behaviour: Behaviour) -> Iterator[Sample]:
    """Yields the samples of the behaviour of one run, without its step timing."""
    for k, time in enumerate(behaviour.time.tolist()):
        yield Sample(time, {signal: values[k] for signal, values in behaviour.signals.items()})


def collect(names: Names, samples: Iterable[Sample]) -> Behaviour:
    """Returns the behaviour of a sequence of samples.

    Raises:
        ValueError: There are no samples, or a row is inconsistent with ``names``.
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
    """Returns a mask of the late steps, ``(steps,)``; None for a robot without its own clock."""
    known = [moment for moment in moments if moment is not None]
    return np.array([moment.late for moment in known]) if known else None


def forward_displacement(behaviour: Behaviour) -> FloatArray:
    """Returns the forward displacement d(T) - d(1) of the root body along the world's x axis.

    Source: the paper, section III (fitness of the repair EA).

    Returns:
        Displacement of each run, m, ``(...)``; ``()`` for a single run.
    """
    x = behaviour["base_position"][..., 0]
    with np.errstate(invalid="ignore"):  # a log may contain infinity: the displacement is NaN
        return np.asarray(x[..., -1] - x[..., 0])
