"""The state of a robot at each step of a trial, as well as its log tells it.

Positions are noisy; how far a body moved between two steps is known better, from its velocity. So a
position is averaged over the steps around it, each moved along by the velocities between.
"""

from collections.abc import Mapping

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.trials.behaviour import Behaviour, Signal

JOINTS: tuple[Signal, ...] = ("joint_positions", "joint_velocities")
IMU: tuple[Signal, ...] = ("base_orientation", "base_angular_velocity")
BASE: tuple[Signal, ...] = ("base_position", "base_linear_velocity")
ONBOARD: tuple[Signal, ...] = JOINTS + IMU
"""The part of the state that a robot can tell by itself."""
STATE: tuple[Signal, ...] = ONBOARD + BASE
"""The signals that make up the state."""

MOSTLY, HALF = 0.6, 0.5
"""From which share of contradicting moves on there is noise, in the mean of the columns and in
each. Where it is all there is, two in three contradict each other; without noise fewer than a half
do, but for joints that tremble."""

OF_TURNS = 0.5
"""Which part of the moves may be left, where they are no noise. Of the noise of 370 trials with a
gap 0.98 was left, and of a cheetah that trembles less than 0.001."""

_SMOOTHED: tuple[tuple[Signal, Signal, int, float], ...] = (
    ("joint_positions", "joint_velocities", 3, 1e-3),
    ("base_position", "base_linear_velocity", 6, 1e-4),
)
"""Which positions move by which velocities, over how many steps to either side they are averaged,
and what noise, in their unit, is not worth it."""


def estimated_states(
    behaviour: Behaviour, signals: tuple[Signal, ...] = STATE
) -> Mapping[Signal, FloatArray]:
    """Returns the state at each step.

    Args:
        behaviour: Of one run.
        signals: The parts of the state that are to be estimated.

    Returns:
        Each signal, ``(steps, width)``. Where no noise shows it is what was logged, to the bit;
        NaN where something that it would be estimated from was not observed, or a step that was
        late lies between.
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
    """How far the velocities lead from each step to the next.

    Physics moves a body by the velocity that it has at the end of a step, and a control step of two
    physics steps ends with one half of the way and passes the middle with the other.
    """
    return np.asarray((velocities[:-1] + 3 * velocities[1:]) / 4 * timestep)


def _is_noise(moved: FloatArray, little: float) -> bool:
    """Whether what the velocities do not explain is mostly noise, in every column, and not little.

    Noise that puts a position too high at one step makes the move to it too long and the one from
    it too short, so it has successive moves contradict each other, two times in three where it is
    all there is. What impacts and the length of a step leave unexplained rather persists. A joint
    may tremble, but not all of them do at every step.
    """
    product = moved[1:] * moved[:-1]
    known = np.isfinite(product)
    contradicting = np.sum(known & (product < 0), axis=0)
    shares = contradicting / np.maximum(known.sum(axis=0), 1)
    enough = np.abs(moved[np.isfinite(moved)])
    return bool(
        len(enough)
        and np.median(enough) > little
        and shares.mean() > MOSTLY
        and np.all(shares > HALF)
    )


def _is_of_turns(moved: FloatArray, turns: FloatArray) -> bool:
    """Whether what is left of the moves is in truth how the velocities change within each step.

    A robot that is driven to and fro at every step moves like one that is measured with noise. But
    its moves then follow from its velocities: by another weight of the two than that of a control
    step of two physics steps. Of noise, next to nothing follows.
    """
    known = np.isfinite(moved) & np.isfinite(turns)
    rest, turn = np.where(known, moved, 0.0), np.where(known, turns, 0.0)
    weights = (rest * turn).sum(axis=0) / np.maximum((turn * turn).sum(axis=0), 1e-300)
    left = np.abs(rest - weights * turn)[known]
    return bool(np.median(left) < OF_TURNS * np.median(np.abs(rest[known])))


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
