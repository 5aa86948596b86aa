"""What a gait is like in each window of a run, in numbers that do not say when a stride begins."""

from collections.abc import Mapping

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray

GROUPS: Mapping[str, float] = {
    "duty": 0.1,
    "sequence": 0.3,
    "phase": 0.3,
    "rhythm": 0.3,
    "posture": 0.1,
    "excursion": 0.1,
}
"""The groups of features, and what counts as a large difference in each: a part of the time, a
part of the transitions, coherency, Hz, and twice the unit of the column (radians, or readings)."""

FASTEST = 8.0
"""Motion above this is contact noise rather than gait, Hz."""
STILL = 0.05
"""Motion of less than this (standard deviation, in the column's unit) counts as stillness."""
LEVEL = 0.5
"""A reading above it is on: where a binary one changes, or an angle passes half of its range."""
STEADY = 5
"""Steps of which most must be on before a reading is taken to have come on: contact chatters."""


class Gait:
    """The features of many runs, cut into windows of equal length.

    Source: Hildebrand (1965) for duty factor, phase and footfall sequence; see ``gait_pattern``.

    Args:
        values: ``(n, steps, columns)``, the readings first.
        seen: ``(steps, columns)``: what is looked at; the rest may be anything, NaN included.
        readings: How many of the columns are readings of the controller.
        timestep: Seconds between two steps.
        windows: How many windows; steps that are left over at the end are not looked at.

    Attributes:
        duty: ``(n, windows, readings)``, part of the time that each is on.
        sequence: ``(n, windows, readings²)``, how often one comes on next after another.
        phase: ``(n, windows, pairs)``, complex: the coherency of every two columns.
        rhythm: ``(n, windows, frequencies)``, the part of all power up to each frequency.
        posture: ``(n, windows, columns)``, the mean.
        excursion: ``(n, windows, columns)``, the standard deviation.
        resolution: Hz between two frequencies.
    """

    def __init__(
        self, values: FloatArray, seen: BoolArray, readings: int, timestep: float, windows: int
    ) -> None:
        runs, steps, columns = values.shape
        length = steps // windows
        whole = windows * length
        seen = seen[:whole].reshape(windows, length, columns)
        kept = np.zeros((runs, windows, length, columns))
        np.copyto(kept, values[:, :whole].reshape(kept.shape), where=seen)
        # Without it, part of a stride at either end would tell when the strides begin.
        taper = np.sin(np.pi * (np.arange(length) + 0.5) / length) ** 2
        share = np.where(seen.any(axis=1), taper @ seen, 1)
        self.posture = taper @ kept / share
        on = kept[..., :readings] > LEVEL
        self.duty = taper @ on / share[:, :readings]
        self.sequence = _sequence(on, taper)
        kept -= self.posture[:, :, np.newaxis]
        if not seen.all():
            kept *= seen
        self.excursion = np.sqrt(taper @ np.square(kept) / share)
        self.resolution = 1 / (length * timestep)
        self.phase, self.rhythm = _spectral(kept, taper, max(1, int(FASTEST / self.resolution)))


def differences(one: Gait, other: Gait) -> dict[str, FloatArray]:
    """Returns how much two sets of gaits differ, by group, ``(n, windows, features)`` each.

    A sequence and a rhythm are one feature: the part of the transitions that are different, and
    how far in Hz the power would have to be moved.
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


def observed(seen: BoolArray, readings: int) -> dict[str, BoolArray]:
    """Returns which features anything is known of, by group, ``(windows, features)`` each.

    Args:
        seen: ``(windows, columns)``: whether a column was seen in a window.
        readings: How many of the columns are readings.
    """
    first, second = _pairs(seen.shape[1])
    return {
        "duty": seen[:, :readings],
        "sequence": np.asarray(seen[:, :readings].any(axis=1, keepdims=True)),
        "phase": seen[:, first] & seen[:, second],
        "rhythm": np.asarray(seen.any(axis=1, keepdims=True)),
        "posture": seen,
        "excursion": seen,
    }


def _pairs(columns: int) -> tuple[IndexArray, IndexArray]:
    first, second = np.triu_indices(columns, 1)
    return first, second


def _sequence(on: BoolArray, taper: FloatArray) -> FloatArray:
    """How often each reading comes on next after each other one, as a part of all transitions."""
    runs, windows, length, readings = on.shape
    last = max(length - STEADY + 1, 0)
    counted = np.zeros((runs, windows, last, readings), dtype=np.uint8)
    for k in range(STEADY):
        counted += on[:, :, k : k + last]
    most = counted > STEADY // 2
    onsets = (most[:, :, 1:] & ~most[:, :, :-1]).reshape(runs * windows, -1)
    # In the order of time, and of columns where two come on at once.
    where, event = np.nonzero(onsets)
    moment, which = np.divmod(event, max(readings, 1))
    together = where[1:] == where[:-1]
    kind = (where[1:] * readings + which[:-1]) * readings + which[1:]
    counts = np.bincount(
        kind[together],
        weights=taper[moment[1:]][together],
        minlength=runs * windows * readings**2,
    ).reshape(runs, windows, -1)
    # One more than there were: a single transition is not yet a sequence.
    return np.asarray(counts / (counts.sum(axis=-1, keepdims=True) + 1))


def _spectral(
    centred: FloatArray, taper: FloatArray, frequencies: int
) -> tuple[FloatArray, FloatArray]:
    """The coherency of every two columns, and the part of all power up to each frequency."""
    runs, windows, length, columns = centred.shape
    step = np.arange(length) + 0.5
    angle = 2 * np.pi * np.arange(1, frequencies + 1)[:, np.newaxis] * step / length
    # By a product of matrices, because only the lowest of the frequencies are needed.
    basis = np.concatenate([np.cos(angle), np.sin(angle)]) * taper
    # So that the power over all frequencies is the variance.
    basis *= np.sqrt(2 / (length * np.sum(taper**2)))
    parts = (basis @ centred).reshape(runs, windows, 2, frequencies, columns)
    lines = parts[:, :, 0] + 1j * parts[:, :, 1]
    power = np.square(parts).sum(axis=2)
    first, second = _pairs(columns)
    total = power.sum(axis=2) + STILL**2
    cross = (lines.swapaxes(-1, -2) @ lines.conj())[..., first, second]
    # In C order, as everything else: the order in memory decides the order in which numpy adds.
    phase = np.ascontiguousarray(cross / np.sqrt(total[..., first] * total[..., second]))
    moved = power.sum(axis=3)
    rhythm = moved.cumsum(axis=2) / (moved.sum(axis=2, keepdims=True) + STILL**2)
    return phase, rhythm
