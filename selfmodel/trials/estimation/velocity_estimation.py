"""Joint velocities estimated from logged joint positions, for logs without velocities."""

import dataclasses

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.trials.behaviour import Behaviour

HALF_WIDTH = 0.05
"""Half width of the smoother, s: long against encoder noise, short against a limb's motion."""

_DEGREE = 3
_MIN_HALF_WIDTH = 2
"""Smallest half width of the smoother, in steps: a cubic has four coefficients."""


def with_joint_velocities(behaviour: Behaviour) -> Behaviour:
    """Returns a behaviour with joint velocities; a behaviour that has any is returned unchanged.

    The velocity at a step is the slope of the cubic polynomial of least squares over the positions
    within ``HALF_WIDTH`` (Savitzky & Golay 1964, Analytical Chemistry 36), with a window that is
    shifted inwards at the ends of the behaviour.

    Args:
        behaviour: Behaviour of one run.

    Returns:
        The behaviour with estimated joint velocities. A velocity is NaN if a position in its window
        is unknown, or a step in its window is late.
    """
    if not lacks_joint_velocities(behaviour):
        return behaviour
    velocities = _slopes(behaviour)
    signals = {**behaviour.signals, "joint_velocities": velocities}
    return dataclasses.replace(behaviour, signals=signals)


def lacks_joint_velocities(behaviour: Behaviour) -> bool:
    """Returns whether joint positions were observed and no joint velocity was."""
    velocities = behaviour.signals.get("joint_velocities")
    return bool(
        np.isfinite(behaviour["joint_positions"]).any()
        and (velocities is None or not np.isfinite(velocities).any())
    )


def _slopes(behaviour: Behaviour) -> FloatArray:
    positions, steps = behaviour["joint_positions"], behaviour.steps
    slopes = np.full(positions.shape, np.nan)
    if steps <= 2 * _MIN_HALF_WIDTH:
        return slopes
    timestep = float(behaviour.time[1] - behaviour.time[0])
    half = max(_MIN_HALF_WIDTH, min(round(HALF_WIDTH / timestep), (steps - 1) // 2))
    offsets = np.arange(-half, half + 1)
    known = np.isfinite(positions)
    if behaviour.late is not None:
        known &= ~behaviour.late[:, np.newaxis]
    for step in range(steps):
        centre = min(max(step, half), steps - 1 - half)
        rows = centre + offsets
        weights = _slope_weights(half, step - centre) / timestep
        slopes[step] = np.where(known[rows].all(axis=0), weights @ positions[rows], np.nan)
    return slopes


def _slope_weights(half: int, position: int) -> FloatArray:
    """Returns the weights of the positions of a window for the slope at one of them, per step."""
    offsets = np.arange(-half, half + 1)
    powers = np.vander(offsets / half, _DEGREE + 1, increasing=True)
    at = position / half
    slope = np.array([0.0, 1.0, 2 * at, 3 * at**2]) / half
    return np.asarray(slope @ np.linalg.pinv(powers))
