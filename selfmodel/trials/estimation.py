"""Estimates from the logged signals of one run: smoothed positions, velocities, encoders' noise.

Logged positions are noisy; the displacement between two steps is more accurate from the velocity.
An estimated position is the mean of the positions of the neighbouring steps, each propagated by the
velocities in between.
"""

import math
from collections.abc import Mapping

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.trials.signals import Signal
from selfmodel.trials.trajectory import Trajectory

JOINTS: tuple[Signal, ...] = ("joint_positions", "joint_velocities")
IMU: tuple[Signal, ...] = ("base_orientation", "base_angular_velocity")
BASE: tuple[Signal, ...] = ("base_position", "base_linear_velocity")
ONBOARD: tuple[Signal, ...] = JOINTS + IMU
"""Signals of the state that onboard sensors measure."""
STATE: tuple[Signal, ...] = ONBOARD + BASE
"""Signals of the whole state."""


def known_steps(states: Mapping[Signal, FloatArray]) -> BoolArray:
    """Returns a mask of the steps at which a prediction can begin, ``(steps,)``.

    Some hinge of each joint signal is known there, and all other signals completely: a hinge
    without an encoder does not make the steps of a trial unknown.
    """
    known = [known_rows(signal, rows) for signal, rows in states.items()]
    return np.asarray(np.logical_and.reduce(known))


def known_rows(signal: Signal, values: FloatArray) -> BoolArray:
    """Returns a mask of the steps at which one signal is known; see ``known_steps``."""
    known = np.isfinite(values)
    return np.asarray(known.any(axis=1) if signal in JOINTS else known.all(axis=1))


NOISE_SHARE, NOISE_SHARE_PER_COLUMN = 0.6, 0.5
"""Smallest shares of successive residuals of opposite sign that count as noise: in the mean over
the columns, and in each column. For pure noise the share is two thirds; without noise it is below
one half, except for joints that oscillate at every step."""

MAX_UNEXPLAINED_SHARE = 0.5
"""Largest share of the residuals left after regression on the velocity changes at which the
residuals count as dynamics, not noise. Noise in 370 trials with a reality gap left 0.98; an
oscillating cheetah left less than 0.001."""

_SMOOTHED: tuple[tuple[Signal, Signal, int, float], ...] = (
    ("joint_positions", "joint_velocities", 3, 1e-3),
    ("base_position", "base_linear_velocity", 6, 1e-4),
)
"""Position signal, its velocity signal, half width of the mean in steps, and the smallest noise
that is smoothed, in the position's unit."""


@np.errstate(invalid="ignore", over="ignore")  # infinite values are handled as not observed
def estimated_states(
    trajectory: Trajectory, signals: tuple[Signal, ...] = STATE
) -> Mapping[Signal, FloatArray]:
    """Returns the estimated state at each step of one run, ``(steps, width)`` for each signal.

    A signal without detectable noise is the logged signal, bit-identical, and so is a position
    whose velocity was never observed. Otherwise the result is NaN where a value it depends on was
    not observed, or a late step is in between.
    """
    states = {signal: trajectory[signal] for signal in signals}
    timestep = float(trajectory.time[1] - trajectory.time[0]) if trajectory.steps > 1 else 0.0
    for position, velocity, half_width, smallest_noise in _SMOOTHED:
        if position in states:
            values = trajectory[position]
            displacements = _integrated(trajectory[velocity], timestep, trajectory.substeps)
            if trajectory.late is not None:
                late = trajectory.late[1:, np.newaxis]
                displacements = np.where(late, np.nan, displacements)
            residuals = np.diff(values, axis=0) - displacements
            changes = np.diff(trajectory[velocity], axis=0) * timestep
            if _is_noise(residuals, smallest_noise) and not _is_linear_in(changes, residuals):
                states[position] = _averaged(
                    values, trajectory[velocity], displacements, half_width
                )
    return states


def _integrated(velocities: FloatArray, timestep: float, substeps: int) -> FloatArray:
    """Returns displacements between successive steps from velocities, ``(steps - 1, width)``.

    The integrator is semi-implicit: a physics step moves by the velocity at its end. Of velocities
    that change evenly, those at the start and the end of a control step of s physics steps have the
    weights (s - 1) / 2s and (s + 1) / 2s.
    """
    weighted = (substeps - 1) * velocities[:-1] + (substeps + 1) * velocities[1:]
    return np.asarray(weighted / (2 * substeps) * timestep)


def _is_noise(residuals: FloatArray, smallest_noise: float) -> bool:
    """Returns whether residual displacements are mostly noise, in every column that has any.

    A position error makes the residual before it too large and the residual after it too small, so
    successive residuals have opposite signs: in two of three pairs for pure noise. Residuals from
    impacts and from the step length persist in sign. Single joints may oscillate at every step, but
    not all of them.
    """
    product = residuals[1:] * residuals[:-1]
    known = np.isfinite(product)
    counts = known.sum(axis=0)
    counted = counts > 0
    shares = np.sum(known & (product < 0), axis=0)[counted] / counts[counted]
    magnitudes = np.abs(residuals[np.isfinite(residuals)])
    return bool(
        len(magnitudes)
        and len(shares)
        and np.median(magnitudes) > smallest_noise
        and shares.mean() > NOISE_SHARE
        and np.all(shares > NOISE_SHARE_PER_COLUMN)
    )


def _is_linear_in(changes: FloatArray, residuals: FloatArray) -> bool:
    """Returns whether the residual displacements are a linear function of the velocity changes.

    The residuals of a robot whose joints oscillate at every step alternate in sign like noise, but
    are proportional to the velocity changes: the step has other integration weights than those of
    two physics steps. Noise is not proportional to the velocity changes.
    """
    known = np.isfinite(residuals) & np.isfinite(changes)
    y, x = np.where(known, residuals, 0.0), np.where(known, changes, 0.0)
    slopes = (y * x).sum(axis=0) / np.maximum((x * x).sum(axis=0), 1e-300)
    unexplained = np.abs(y - slopes * x)[known]
    return bool(np.median(unexplained) < MAX_UNEXPLAINED_SHARE * np.median(np.abs(y[known])))


def _averaged(
    values: FloatArray, velocities: FloatArray, displacements: FloatArray, half_width: int
) -> FloatArray:
    """Returns positions averaged along the displacements, ``(steps, width)``; NaN if unknown.

    A position whose velocity was never observed is returned as it is.
    """
    steps, path = len(values), _summed(np.where(np.isnan(displacements), 0.0, displacements))
    deviations = values - path
    known = np.isfinite(deviations) & np.isfinite(velocities)
    sums = _summed(np.where(known, deviations, 0.0))
    counts = _summed(known.astype(np.float64))
    first = np.maximum(np.arange(steps) - half_width, 0)
    last = np.minimum(np.arange(steps) + half_width + 1, steps)
    all_known = counts[last] - counts[first] == (last - first)[:, np.newaxis]
    unknown_counts = _summed(np.isnan(displacements).astype(np.float64))
    all_known &= unknown_counts[last - 1] == unknown_counts[first]
    mean = (sums[last] - sums[first]) / (last - first)[:, np.newaxis] + path
    unmeasured = np.isnan(velocities).all(axis=0)
    return np.where(unmeasured, values, np.where(all_known, mean, np.nan))


def _summed(values: FloatArray) -> FloatArray:
    """Returns the sums of the first k rows, ``(steps + 1, width)``, from k = 0."""
    return np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])


HALF_WIDTH = 0.05
"""Half width of the smoother, s: long against encoder noise, short against a limb's motion."""

_DEGREE, _MIN_HALF_WIDTH = 3, 2
"""Degree of the smoother, and its smallest half width, steps: a cubic has four coefficients."""


def with_joint_velocities(trajectory: Trajectory) -> Trajectory:
    """Returns a trajectory with joint velocities; one that has any is returned unchanged.

    The velocity at a step is the slope of the cubic polynomial of least squares over the positions
    within ``HALF_WIDTH`` (Savitzky & Golay 1964, Analytical Chemistry 36), with a window that is
    shifted inwards at the ends of the trajectory. It is NaN if a position in its window is unknown,
    or a step in its window is late.
    """
    lacks = lacks_joint_velocities(trajectory)
    return (
        trajectory.with_signals({"joint_velocities": _slopes(trajectory)}) if lacks else trajectory
    )


def lacks_joint_velocities(trajectory: Trajectory) -> bool:
    """Returns whether joint positions were observed and no joint velocity was."""
    velocities = trajectory.signals.get("joint_velocities")
    return bool(
        np.isfinite(trajectory["joint_positions"]).any()
        and (velocities is None or not np.isfinite(velocities).any())
    )


def _slopes(trajectory: Trajectory) -> FloatArray:
    positions, steps = trajectory["joint_positions"], trajectory.steps
    slopes = np.full(positions.shape, np.nan)
    if steps <= 2 * _MIN_HALF_WIDTH:
        return slopes
    timestep = float(trajectory.time[1] - trajectory.time[0])
    half = max(_MIN_HALF_WIDTH, min(round(HALF_WIDTH / timestep), (steps - 1) // 2))
    offsets = np.arange(-half, half + 1)
    known = np.isfinite(positions)
    if trajectory.late is not None:
        known &= ~trajectory.late[:, np.newaxis]
    inverse = np.linalg.pinv(np.vander(offsets / half, _DEGREE + 1, increasing=True))
    for step in range(steps):
        centre = min(max(step, half), steps - 1 - half)
        rows, at = centre + offsets, (step - centre) / half
        weights = np.array([0.0, 1.0, 2 * at, 3 * at**2]) / half @ inverse / timestep
        slopes[step] = np.where(known[rows].all(axis=0), weights @ positions[rows], np.nan)
    return slopes


PLAY, NOISE_FACTOR = 0.01, 2.0
"""Motion of a jammed joint by elasticity and backlash, rad; and factor on an encoder's noise in the
tolerance: noise alone must be a small part of it."""

_ORDER = 4
"""Order of the differences between neighbouring steps: it suppresses motion, and not noise."""

_NORMAL_MEDIAN = 0.6745  # median of the absolute value of a standard normal variable


def standing_tolerance(positions: FloatArray) -> FloatArray:
    """Returns the root mean square motion up to which a hinge counts as standing, rad."""
    return np.hypot(PLAY, NOISE_FACTOR * encoder_noise(positions))


def encoder_noise(positions: FloatArray) -> FloatArray:
    """Returns the standard deviation of the noise of each encoder, ``(hinges,)`` rad.

    The larger of two estimates: white noise with the same median fourth difference, and the
    rounding error of an encoder with steps as large as the smallest difference between two of its
    values. The first alone is 0 for a hinge that stands between two steps of its encoder. Both are
    0 for too few values, or one. Unknown positions, ``(steps, hinges)`` rad, are NaN.
    """
    return np.array([_noise(column) for column in positions.T], dtype=np.float64)


def _noise(column: FloatArray) -> float:
    differences = np.abs(np.diff(column, _ORDER))
    known = differences[np.isfinite(differences)]
    white = float(np.median(known)) / _NORMAL_MEDIAN if len(known) else 0.0
    steps = np.diff(np.unique(column[np.isfinite(column)]))
    rounding = float(steps.min()) / math.sqrt(12) if len(steps) else 0.0
    return max(white / math.sqrt(math.comb(2 * _ORDER, _ORDER)), rounding)
