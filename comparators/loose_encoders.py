"""Encoders of a detached limb: they freeze, or they follow the motor that lost its load.

The encoder of a joint whose limb is lost is not predicted by the model of the robot. Often the
encoder belongs to the motor and stays: it then measures the motor's own motion, which follows the
commands with a lag. Such an encoder is no evidence against the loss of the limb.
"""

from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray
from selfmodel.simulation.requests import END
from selfmodel.trials.behaviour import Behaviour

FROZEN = 1e-6
"""Range of predicted angles below which a hinge is welded or detached, rad. A welded hinge moves by
less than 1e-9 rad in a segment."""

TIME_CONSTANTS = (0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0)
"""Time constants of a motor without a load that are tried, control steps: its angle follows the
command as the output of a low-pass filter of first order."""

MAX_REMAINDER = 0.1
"""Largest share of the variance of an encoder that a linear function of commands may leave if the
encoder follows them."""

DERIVED = 0.999
"""Smallest correlation of a reading with an angle from which it is derived."""

MIN_KNOWN = 20
"""Known rows that a fit needs."""


@dataclass(frozen=True, eq=False)
class LooseEncoders:
    """Angles of the encoders that follow commands, and the readings that are derived from angles.

    Attributes:
        hinges: Columns of the encoders that follow commands.
        angles: Their fitted angles in the segments, ``(segments, horizon + 1, hinges)`` rad.
        velocities: Velocities of the fitted angles, likewise, rad/s.
        sensors: Columns of the readings derived from these hinges.
        readings: The derived readings, ``(segments, horizon + 1, sensors)``.
        source: Index into ``hinges`` of each of these readings.
    """

    hinges: IndexArray
    angles: FloatArray
    velocities: FloatArray
    sensors: IndexArray
    readings: FloatArray
    source: IndexArray


def loose_encoders(behaviour: Behaviour, starts: IndexArray, horizon: int) -> LooseEncoders | None:
    """Returns the encoders of a trial that follow commands; None if there are none.

    Encoders of intact joints may be among them: they are used only for hypotheses that detach the
    joint.

    Args:
        behaviour: The logged behaviour.
        starts: Step at which each segment begins, ``(segments,)``.
        horizon: Control steps of a segment.
    """
    commands, logged = behaviour["commands"], behaviour["joint_positions"]
    filtered = np.hstack([_low_pass(commands, constant) for constant in TIME_CONSTANTS])
    first = round((1 - END) * behaviour.steps)
    fits = [_following(column, filtered, first) for column in logged.T]
    hinges = np.array([i for i, fit in enumerate(fits) if fit is not None], dtype=np.intp)
    if not len(hinges):
        return None
    angles = np.stack([fit for fit in fits if fit is not None], axis=1)
    velocities = np.gradient(angles, behaviour.time, axis=0)
    derived = [
        (sensor, source, line)
        for sensor, readings in enumerate(behaviour["sensors"].T)
        for source, hinge in enumerate(hinges)
        for line in (_derived(readings[first:], logged[first:, hinge]),)
        if line is not None
    ]
    rows = starts[:, np.newaxis] + np.arange(horizon + 1)
    readings = [line[0] + line[1] * angles[:, source] for _, source, line in derived]
    return LooseEncoders(
        hinges=hinges,
        angles=angles[rows],
        velocities=velocities[rows],
        sensors=np.array([sensor for sensor, _, _ in derived], dtype=np.intp),
        readings=np.stack(readings, axis=1)[rows] if readings else np.empty((*rows.shape, 0)),
        source=np.array([source for _, source, _ in derived], dtype=np.intp),
    )


def detached_hinges(positions: FloatArray, resting: FloatArray) -> BoolArray:
    """Returns a mask of the hinges that a hypothesis detaches, ``(n, hinges)``.

    Args:
        positions: Predicted joint positions, ``(n, segments, horizon + 1, hinges)`` rad.
        resting: Angle at which a detached hinge is predicted, ``(hinges,)`` rad.
    """
    return stands(positions) & np.asarray(np.abs(positions[:, 0, 0] - resting) < FROZEN)


def stands(positions: FloatArray) -> BoolArray:
    """Returns a mask of the hinges that a hypothesis predicts to stand, ``(n, hinges)``.

    Args:
        positions: As for ``detached_hinges``.
    """
    return np.asarray(np.ptp(positions, axis=(1, 2)) < FROZEN)


def with_loose_encoders(
    simulated: Behaviour, loose: LooseEncoders, detached: BoolArray
) -> Behaviour:
    """Returns predictions in which the encoders of detached hinges follow their commands.

    Args:
        simulated: Predicted signals, ``(n, segments, horizon + 1, width)`` each.
        loose: Encoders that follow commands.
        detached: Mask of the detached hinges of each hypothesis, ``(n, hinges)``.
    """
    followed = {
        "joint_positions": (loose.hinges, loose.angles, np.arange(len(loose.hinges))),
        "joint_velocities": (loose.hinges, loose.velocities, np.arange(len(loose.hinges))),
        "sensors": (loose.sensors, loose.readings, loose.source),
    }
    signals = dict(simulated.signals)
    for signal, values in simulated.signals.items():
        if signal in followed:
            columns, fitted, source = followed[signal]
            changed = values.copy()
            for k, column in enumerate(columns.tolist()):
                rows = detached[:, loose.hinges[source[k]]]
                changed[rows, :, :, column] = fitted[:, :, k]
            signals[signal] = changed
    return Behaviour(simulated.names, simulated.time, signals)


def _following(angles: FloatArray, filtered: FloatArray, first: int) -> FloatArray | None:
    """Returns the linear function of one motor's commands that an encoder follows, ``(steps,)``.

    Args:
        angles: Logged angles, ``(steps,)`` rad.
        filtered: Commands after each low-pass filter, ``(steps, filters * motors)``.
        first: First row of the fit: the limb may be lost during the trial.

    Returns:
        None if the encoder is not such a function, or stands.
    """
    best, fitted = MAX_REMAINDER, None
    for column in filtered.T:
        line = _line(angles[first:], column[first:])
        if line is not None and line[2] < best:
            best, fitted = line[2], line[0] + line[1] * column
    return fitted if fitted is not None and np.isfinite(fitted).all() else None


def _low_pass(commands: FloatArray, constant: float) -> FloatArray:
    """Returns commands after a low-pass filter of first order, ``(steps, motors)``.

    Row k contains the commands up to row k - 1: command k has its effect after row k.
    """
    held = _held(commands)
    gain = 1 - np.exp(-1 / constant) if constant else 1.0
    filtered = np.empty_like(held)
    filtered[0] = held[0]
    for k in range(1, len(held)):
        filtered[k] = filtered[k - 1] + gain * (held[k - 1] - filtered[k - 1])
    return filtered


def _held(commands: FloatArray) -> FloatArray:
    """Returns commands in which an unknown one is the last known one; 0 before the first."""
    known = np.where(np.isfinite(commands), np.arange(len(commands))[:, np.newaxis] + 1, 0)
    before = np.vstack([np.zeros((1, commands.shape[1])), commands])
    return np.asarray(np.take_along_axis(before, np.maximum.accumulate(known), axis=0))


def _derived(readings: FloatArray, angles: FloatArray) -> tuple[float, float] | None:
    line = _line(readings, angles)
    return line[:2] if line is not None and line[2] < 1 - DERIVED**2 else None


def _line(values: FloatArray, over: FloatArray) -> tuple[float, float, float] | None:
    """Returns intercept, slope and the share of the variance that the line leaves."""
    known = np.isfinite(values) & np.isfinite(over)
    if known.sum() < MIN_KNOWN:
        return None
    y, x = values[known], over[known]
    variance, spread = float(y.var()), float(x.var())
    if variance < _STANDS or spread < _STANDS:
        return None
    slope = float(np.mean((x - x.mean()) * (y - y.mean()))) / spread
    left = float(np.mean(np.square(y - y.mean() - slope * (x - x.mean())))) / variance
    return float(y.mean()) - slope * float(x.mean()), slope, left


_STANDS = 1e-6  # rad^2: a milliradian
