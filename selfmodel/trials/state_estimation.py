"""State estimation: smoothed positions from logged positions and velocities.

Logged positions are noisy; the displacement between two steps is known better, from the velocity.
A position is the mean of the positions of the neighbouring steps, each propagated by the
velocities in between.
"""

from collections.abc import Mapping

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.signals import Signal

JOINTS: tuple[Signal, ...] = ("joint_positions", "joint_velocities")
IMU: tuple[Signal, ...] = ("base_orientation", "base_angular_velocity")
BASE: tuple[Signal, ...] = ("base_position", "base_linear_velocity")
ONBOARD: tuple[Signal, ...] = JOINTS + IMU
"""The part of the state that onboard sensors measure."""
STATE: tuple[Signal, ...] = ONBOARD + BASE
"""The signals that make up the state."""

NOISE_SHARE, NOISE_SHARE_PER_COLUMN = 0.6, 0.5
"""Smallest shares of successive residuals of opposite sign that count as noise: in the mean over
the columns, and in each column. For pure noise the share is two thirds; without noise it is below
one half, except for joints that oscillate at every step."""

MAX_UNEXPLAINED_SHARE = 0.5
"""Largest share of the residuals left after regression on the velocity changes at which the
residuals count as dynamics, not noise. Noise in 370 trials with a gap left 0.98; an oscillating
cheetah left less than 0.001."""

_SMOOTHED: tuple[tuple[Signal, Signal, int, float], ...] = (
    ("joint_positions", "joint_velocities", 3, 1e-3),
    ("base_position", "base_linear_velocity", 6, 1e-4),
)
"""Position signal, its velocity signal, half width of the mean in steps, and the smallest noise
that is smoothed, in the position's unit."""


def estimated_states(
    behaviour: Behaviour, signals: tuple[Signal, ...] = STATE
) -> Mapping[Signal, FloatArray]:
    """Returns the estimated state at each step.

    Args:
        behaviour: Behaviour of one run.
        signals: The signals of the state to estimate.

    Returns:
        Each signal, ``(steps, width)``. A signal without detectable noise is the logged signal,
        bit-identical. The result is NaN where a value it depends on was not observed, or a late
        step is in between.
    """
    states = {signal: behaviour[signal] for signal in signals}
    timestep = float(behaviour.time[1] - behaviour.time[0]) if behaviour.steps > 1 else 0.0
    for position, velocity, reach, little in _SMOOTHED:
        if position in states:
            values = behaviour[position]
            ways = _steps_along(behaviour[velocity], timestep)
            if behaviour.late is not None:
                ways = np.where(behaviour.late[1:, np.newaxis], np.nan, ways)
            moved = np.diff(values, axis=0) - ways
            turns = np.diff(behaviour[velocity], axis=0) * timestep
            if _is_noise(moved, little) and not _is_of_turns(moved, turns):
                states[position] = _averaged(values, behaviour[velocity], ways, reach)
    return states


def _steps_along(velocities: FloatArray, timestep: float) -> FloatArray:
    """Displacement from each step to the next, integrated from the velocities.

    The integrator is semi-implicit: a physics step moves by the velocity at its end. For a control
    step of two physics steps the weights of its first and last velocity are 1/4 and 3/4.
    """
    return np.asarray((velocities[:-1] + 3 * velocities[1:]) / 4 * timestep)


def _is_noise(moved: FloatArray, little: float) -> bool:
    """Whether the residual displacements are mostly measurement noise, in every column.

    A position error makes the residual before it too large and the residual after it too small, so
    successive residuals have opposite signs: in two of three pairs for pure noise. Residuals from
    impacts and from the step length persist in sign. Single joints may oscillate at every step, but
    not all of them.
    """
    product = moved[1:] * moved[:-1]
    known = np.isfinite(product)
    contradicting = np.sum(known & (product < 0), axis=0)
    shares = contradicting / np.maximum(known.sum(axis=0), 1)
    enough = np.abs(moved[np.isfinite(moved)])
    return bool(
        len(enough)
        and np.median(enough) > little
        and shares.mean() > NOISE_SHARE
        and np.all(shares > NOISE_SHARE_PER_COLUMN)
    )


def _is_of_turns(moved: FloatArray, turns: FloatArray) -> bool:
    """Whether the residual displacements are a linear function of the velocity changes.

    The residuals of a robot whose joints oscillate at every step look like noise, but are
    proportional to the velocity changes: the step has other integration weights than those of two
    physics steps. Noise is not proportional to the velocity changes.
    """
    known = np.isfinite(moved) & np.isfinite(turns)
    rest, turn = np.where(known, moved, 0.0), np.where(known, turns, 0.0)
    weights = (rest * turn).sum(axis=0) / np.maximum((turn * turn).sum(axis=0), 1e-300)
    left = np.abs(rest - weights * turn)[known]
    return bool(np.median(left) < MAX_UNEXPLAINED_SHARE * np.median(np.abs(rest[known])))


def _averaged(
    values: FloatArray, velocities: FloatArray, ways: FloatArray, reach: int
) -> FloatArray:
    steps = len(values)
    along = np.concatenate([np.zeros((1, values.shape[1])), np.nancumsum(ways, axis=0)])
    still = values - along
    known = np.isfinite(still) & np.isfinite(velocities)
    sums = _summed(np.where(known, still, 0.0))
    counts = _summed(known.astype(np.float64))
    first = np.maximum(np.arange(steps) - reach, 0)
    last = np.minimum(np.arange(steps) + reach + 1, steps)
    all_known = counts[last] - counts[first] == (last - first)[:, np.newaxis]
    unknown_ways = _summed(np.isnan(ways).astype(np.float64))
    all_known &= unknown_ways[last - 1] == unknown_ways[first]
    mean = (sums[last] - sums[first]) / (last - first)[:, np.newaxis] + along
    return np.where(all_known, mean, np.nan)


def _summed(values: FloatArray) -> FloatArray:
    return np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
