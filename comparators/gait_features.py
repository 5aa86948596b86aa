"""Gait features of windows of a run, independent of when a stride begins."""

from collections.abc import Mapping

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray

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

MAX_FREQUENCY = 8.0
"""Upper frequency of a gait, Hz; faster motion is contact noise."""
STILL = 0.05
"""Standard deviation below which a column counts as still, in its unit."""
ON_LEVEL = 0.5
"""Level above which a reading is on: between the values of a binary reading; half an angle's range.
"""
ONSET_STEPS = 5
"""Window of the majority filter on readings before onsets are found, steps: contact chatters."""


class Gait:
    """Gait features of many runs, by windows of equal length.

    Source: Hildebrand (1965) for duty factor, phase and footfall sequence; see ``gait_pattern``.

    Args:
        values: ``(n, steps, columns)``, the readings first.
        observed: Mask of the values to use, ``(steps, columns)``; other values may be NaN.
        readings: Number of columns that are readings of the controller.
        timestep: Control time step, s.
        windows: Number of windows; steps that are left over at the end are ignored.

    Attributes:
        duty: Part of the time that each reading is on, ``(n, windows, readings)``.
        sequence: Frequency of each transition from an onset to the next, as a part of all,
            ``(n, windows, readings²)``.
        phase: Complex coherency of every two columns, ``(n, windows, pairs)``.
        rhythm: Part of all power up to each frequency, ``(n, windows, frequencies)``.
        posture: Mean of each column, ``(n, windows, columns)``.
        excursion: Standard deviation of each column, ``(n, windows, columns)``.
        resolution: Difference of neighbouring frequencies, Hz.
    """

    def __init__(
        self, values: FloatArray, observed: BoolArray, readings: int, timestep: float, windows: int
    ) -> None:
        runs, steps, columns = values.shape
        length = steps // windows
        whole = windows * length
        seen = observed[:whole].reshape(windows, length, columns)
        kept = np.zeros((runs, windows, length, columns))
        np.copyto(kept, values[:, :whole].reshape(kept.shape), where=seen)
        # Without a taper, the parts of strides at both ends would depend on the time shift.
        taper = np.sin(np.pi * (np.arange(length) + 0.5) / length) ** 2
        share = np.where(seen.any(axis=1), taper @ seen, 1)
        self.posture = taper @ kept / share
        on = kept[..., :readings] > ON_LEVEL
        self.duty = taper @ on / share[:, :readings]
        self.sequence = _sequence(on, taper)
        kept -= self.posture[:, :, np.newaxis]
        if not seen.all():
            kept *= seen
        self.excursion = np.sqrt(taper @ np.square(kept) / share)
        self.resolution = 1 / (length * timestep)
        self.phase, self.rhythm = _spectral(
            kept, taper, max(1, int(MAX_FREQUENCY / self.resolution))
        )


def differences(one: Gait, other: Gait) -> dict[str, FloatArray]:
    """Returns the differences of two sets of gaits, by group, ``(n, windows, features)`` each.

    A sequence and a rhythm are one feature each: the part of the transitions that differ, and the
    earth mover's distance of the power spectra, Hz.
    """
    sequence = np.abs(one.sequence - other.sequence).sum(axis=-1, keepdims=True) / 2
    rhythm = np.abs(one.rhythm - other.rhythm).sum(axis=-1, keepdims=True) * one.resolution
    return {
        "duty": np.abs(one.duty - other.duty),
        "sequence": sequence,
        "phase": np.abs(one.phase - other.phase),
        "rhythm": rhythm,
        "posture": np.abs(one.posture - other.posture),
        "excursion": np.abs(one.excursion - other.excursion),
    }


def observed_features(observed: BoolArray, readings: int) -> dict[str, BoolArray]:
    """Returns a mask of the features with an observation, by group, ``(windows, features)`` each.

    Args:
        observed: Mask of the columns with an observation in a window, ``(windows, columns)``.
        readings: Number of columns that are readings.
    """
    first, second = _pairs(observed.shape[1])
    return {
        "duty": observed[:, :readings],
        "sequence": np.asarray(observed[:, :readings].any(axis=1, keepdims=True)),
        "phase": observed[:, first] & observed[:, second],
        "rhythm": np.asarray(observed.any(axis=1, keepdims=True)),
        "posture": observed,
        "excursion": observed,
    }


def _pairs(columns: int) -> tuple[IndexArray, IndexArray]:
    first, second = np.triu_indices(columns, 1)
    return first, second


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
    first, second = _pairs(columns)
    total = power.sum(axis=2) + STILL**2
    cross = (lines.swapaxes(-1, -2) @ lines.conj())[..., first, second]
    # In C order, as all other features: the order in memory is the order in which numpy adds.
    phase = np.ascontiguousarray(cross / np.sqrt(total[..., first] * total[..., second]))
    moved = power.sum(axis=3)
    rhythm = moved.cumsum(axis=2) / (moved.sum(axis=2, keepdims=True) + STILL**2)
    return phase, rhythm
