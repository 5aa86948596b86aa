"""Difference of gait patterns: rhythm, phase and footfall sequence, whatever the time shift."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.comparators.sensor_series import geman_mcclure, observed_signals
from selfmodel.diagnosis.comparator import Prepared
from selfmodel.simulation.requests import ClosedLoop
from selfmodel.trials.signals import Signal
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import Trial

SIGNALS: tuple[Signal, ...] = ("sensors", "joint_positions")

MAX_WINDOWS = 4
"""Windows of a trial, at most."""
MIN_WINDOW = 100
"""Control steps of a window, at least, unless the trial is shorter."""

LARGE_DIFFERENCES: Mapping[str, float] = {
    "duty": 0.1,
    "sequence": 0.3,
    "phase": 0.3,
    "rhythm": 0.3,
    "posture": 0.1,
    "excursion": 0.1,
}
"""Difference that counts as large, per group of features.

The units are a part of the time, a part of the transitions, coherency, Hz, and for the last two the
unit of the column (radians, or readings)."""

Gait = dict[str, FloatArray]
"""Features of gaits by their group; those of phase are complex."""

MAX_FREQUENCY = 8.0
"""Upper frequency of a gait, Hz; faster motion is contact noise."""
STILL = 0.05
"""Standard deviation below which a column counts as still, in its unit."""
ON_LEVEL = 0.5
"""Level above which a reading is on: between the values of a binary reading; half an angle's range.
"""
ONSET_STEPS = 5
"""Window of the majority filter on readings before onsets are found, steps: contact chatters."""


@dataclass(frozen=True)
class GaitPattern:
    """The difference of gait features, which do not depend on when a stride begins.

    A trial is cut into at most four windows, each multiplied by a taper, so that the phase of the
    stride at its beginning does not matter. In each window, six groups of features are compared;
    the bounded loss of a group in a window is one loss:

    * duty: part of the time that each reading is above one half (for a touch: the duty factor);
    * sequence: the order in which readings rise above one half (for touches: the footfall
      sequence), as frequencies of transitions from one reading to the next;
    * phase: the relation between every two readings or joints, as the complex coherency of their
      motion (its angle is the phase, its magnitude how constant the phase is);
    * rhythm: the distribution of the power of all motion over frequency, as a distance in Hz (a
      stride frequency that rises by 1 Hz moves all power by 1 Hz or more);
    * posture and excursion: the mean and the standard deviation of every reading and joint.

    A log does not contain the kind of a sensor: one half separates the values of a touch, and is
    half of the joint's range for an angle. A robot without touch sensors is compared by its joints.
    Unobserved values of the trial are left out of both gaits.

    Source: Hildebrand, "Symmetrical gaits of horses", Science 150 (1965), describes a gait by duty
    factor and phase, and orders gaits by their footfall sequences. The rest is selfmodel's choice.

    Limits: the travel of the robot is not compared. Failures that do not change the gait (a sensor
    that the controller hardly uses) are close to the healthy robot. The order of feet that touch
    down together is decided by noise. A robot that lies still has no gait: its posture decides.
    """

    name: str = "gait-pattern"

    def prepare(self, trial: Trial) -> Prepared:
        """Returns the gait of the trial, from its observed readings and joint positions."""
        signals = observed_signals(trial, SIGNALS, self.name)
        logged = np.concatenate([trial.trajectory[signal] for signal in signals], axis=-1)
        readings = trial.trajectory["sensors"].shape[-1] if "sensors" in signals else 0
        observed, time = np.isfinite(logged), trial.trajectory.time
        timestep = float(time[-1] - time[0]) / (len(time) - 1) if len(time) > 1 else 1.0
        windows = min(MAX_WINDOWS, max(1, len(logged) // MIN_WINDOW))
        length = len(logged) // windows
        in_windows = observed[: windows * length].reshape(windows, length, -1).any(axis=1)
        known = _observed_features(in_windows, readings)
        share = np.stack([known[group].any(axis=-1) for group in LARGE_DIFFERENCES], axis=-1).mean()
        gait_of = partial(
            _gait, observed=observed, readings=readings, timestep=timestep, windows=windows
        )
        gait = gait_of(logged[np.newaxis])

        def losses(simulated: Trajectory) -> FloatArray:
            """Returns the loss of each group of features in each window, ``(n, pieces)``."""
            values = np.concatenate([simulated[signal] for signal in signals], axis=-1)
            differences = _differences(gait_of(values), gait, 1 / (length * timestep))
            by_group = [
                _masked_mean(geman_mcclure(differences[group] / large), known[group])
                for group, large in LARGE_DIFFERENCES.items()
            ]
            return np.asarray((np.stack(by_group, axis=-1) / float(share)).reshape(len(values), -1))

        return Prepared(ClosedLoop(record=signals), losses)


def _gait(
    values: FloatArray, observed: BoolArray, readings: int, timestep: float, windows: int
) -> Gait:
    """Returns the gait features of many runs, by windows of equal length.

    Source: Hildebrand (1965) for duty factor, phase and footfall sequence; see ``GaitPattern``.

    Args:
        values: ``(n, steps, columns)``, the readings first.
        observed: Mask of the values to use, ``(steps, columns)``; other values may be NaN.
        readings: Number of columns that are readings of the controller.
        timestep: Control time step, s.
        windows: Number of windows; steps that are left over at the end are ignored.

    Returns:
        By group, ``(n, windows, features)`` each: the part of the time that each reading is on; the
        frequency of each transition from an onset to the next, as a part of all; the complex
        coherency of every two columns; the part of all power up to each frequency; mean and
        standard deviation of each column.
    """
    runs, steps, columns = values.shape
    length = steps // windows
    whole = windows * length
    seen = observed[:whole].reshape(windows, length, columns)
    kept = np.zeros((runs, windows, length, columns))
    np.copyto(kept, values[:, :whole].reshape(kept.shape), where=seen)
    # Without a taper, the parts of strides at both ends would depend on the time shift.
    taper = np.sin(np.pi * (np.arange(length) + 0.5) / length) ** 2
    share = np.where(seen.any(axis=1), taper @ seen, 1)
    posture = taper @ kept / share
    on = kept[..., :readings] > ON_LEVEL
    kept -= posture[:, :, np.newaxis]
    if not seen.all():
        kept *= seen
    resolution = 1 / (length * timestep)  # difference of neighbouring frequencies, Hz
    phase, rhythm = _spectral(kept, taper, max(1, int(MAX_FREQUENCY / resolution)))
    return {
        "duty": taper @ on / share[:, :readings],
        "sequence": _sequence(on, taper),
        "phase": phase,
        "rhythm": rhythm,
        "posture": posture,
        "excursion": np.sqrt(taper @ np.square(kept) / share),
    }


def _differences(one: Gait, other: Gait, resolution: float) -> Gait:
    """Returns the differences of two sets of gaits, by group, ``(n, windows, features)`` each.

    A sequence and a rhythm are one feature each: the part of the transitions that differ, and the
    earth mover's distance of the power spectra, Hz.
    """
    differences = {group: np.abs(one[group] - other[group]) for group in LARGE_DIFFERENCES}
    for group, unit in (("sequence", 0.5), ("rhythm", resolution)):
        differences[group] = differences[group].sum(axis=-1, keepdims=True) * unit
    return differences


def _observed_features(observed: BoolArray, readings: int) -> dict[str, BoolArray]:
    """Returns a mask of the features with an observation, by group, ``(windows, features)`` each.

    Args:
        observed: Mask of the columns with an observation in a window, ``(windows, columns)``.
        readings: Number of columns that are readings.
    """
    first, second = np.triu_indices(observed.shape[1], 1)
    return {
        "duty": observed[:, :readings],
        "sequence": np.asarray(observed[:, :readings].any(axis=1, keepdims=True)),
        "phase": observed[:, first] & observed[:, second],
        "rhythm": np.asarray(observed.any(axis=1, keepdims=True)),
        "posture": observed,
        "excursion": observed,
    }


def _sequence(on: BoolArray, taper: FloatArray) -> FloatArray:
    """Returns the frequency of each transition between onsets, as a part of all transitions."""
    runs, windows, length, readings = on.shape
    last = max(length - ONSET_STEPS + 1, 0)
    counted = np.zeros((runs, windows, last, readings), dtype=np.uint8)
    for k in range(ONSET_STEPS):
        counted += on[:, :, k : k + last]
    most = counted > ONSET_STEPS // 2
    onsets = (most[:, :, 1:] & ~most[:, :, :-1]).reshape(runs * windows, -1)
    # Ordered by time, then by column for simultaneous onsets.
    where, event = np.nonzero(onsets)
    moment, which = np.divmod(event, max(readings, 1))
    together = where[1:] == where[:-1]
    kind = (where[1:] * readings + which[:-1]) * readings + which[1:]
    counts = np.bincount(
        kind[together],
        weights=taper[moment[1:]][together],
        minlength=runs * windows * readings**2,
    ).reshape(runs, windows, -1)
    # One added to the count: a single transition is not yet a sequence.
    return np.asarray(counts / (counts.sum(axis=-1, keepdims=True) + 1))


def _spectral(
    centred: FloatArray, taper: FloatArray, frequencies: int
) -> tuple[FloatArray, FloatArray]:
    """Returns the coherency of every two columns and the part of all power up to each frequency."""
    runs, windows, length, columns = centred.shape
    step = np.arange(length) + 0.5
    angle = 2 * np.pi * np.arange(1, frequencies + 1)[:, np.newaxis] * step / length
    # A matrix product instead of an FFT, because only the lowest frequencies are needed.
    basis = np.concatenate([np.cos(angle), np.sin(angle)]) * taper
    # Normalised so that the power over all frequencies is the variance.
    basis *= np.sqrt(2 / (length * np.sum(taper**2)))
    parts = (basis @ centred).reshape(runs, windows, 2, frequencies, columns)
    lines = parts[:, :, 0] + 1j * parts[:, :, 1]
    power = np.square(parts).sum(axis=2)
    first, second = np.triu_indices(columns, 1)
    total = power.sum(axis=2) + STILL**2
    cross = (lines.swapaxes(-1, -2) @ lines.conj())[..., first, second]
    # In C order, as all other features: the order in memory is the order in which numpy adds.
    phase = np.ascontiguousarray(cross / np.sqrt(total[..., first] * total[..., second]))
    moved = power.sum(axis=3)
    rhythm = moved.cumsum(axis=2) / (moved.sum(axis=2, keepdims=True) + STILL**2)
    return phase, rhythm


def _masked_mean(values: FloatArray, mask: BoolArray) -> FloatArray:
    """Returns the mean over the last axis of the values in a mask; 0 where the mask is empty."""
    count = np.maximum(mask.sum(axis=-1), 1)
    return np.asarray((values * mask).sum(axis=-1) / count)


GAIT_PATTERN = GaitPattern()
