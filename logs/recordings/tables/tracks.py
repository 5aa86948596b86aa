"""Tracks of a table, from its columns."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from selfmodel.errors import InputError
from selfmodel.logs.recordings.mapping.mapping import TABLE, RecordingMapping, TimeColumn
from selfmodel.logs.recordings.resampling.clock import Clocked, Track, track
from selfmodel.logs.recordings.resampling.tracks import RawTracks
from selfmodel.logs.recordings.series import Column, IntArray, Series, Topic
from selfmodel.logs.recordings.tables.content import NO_TIME, Numbers
from selfmodel.logs.recordings.tables.table import Table

MAX_TIME = 2**62
"""Largest magnitude of a time, ns; sums still fit 64 bits."""


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of a table that have a time.

    Attributes:
        index: Their indices, ``(m,)``.
        series: Their times as those of messages.
        clock: Their times.
    """

    index: IntArray
    series: Series
    clock: Clocked


def rows_of(table: Table, time: TimeColumn) -> Rows:
    """Returns the rows of a table, with times.

    Args:
        table: Table with its time column.
        time: The time column.

    Raises:
        InputError: A column has another length than the time column, or a time is too large.
    """
    values = table.columns[time.column]
    for name, column in table.columns.items():
        if len(column) != len(values):
            raise InputError(
                f"{table.path}: expected {len(values)} rows in {name}, as in {time.column}, got "
                f"{len(column)}: write columns of the same length"
            )
    index = np.flatnonzero(np.isfinite(values) & (values != NO_TIME))
    known = values[index]
    far = np.flatnonzero(np.abs(known) >= MAX_TIME // time.unit)
    if len(far):
        raise InputError(
            f"{table.path}: expected times of at most {MAX_TIME / time.unit:.3g} in "
            f"{time.column}, got {known[far[0]]:.6g} in row {index[far[0]] + 1}: check the unit in "
            f"[time]"
        )
    times = _nanoseconds(known, time.unit)
    missing = len(values) - len(index)
    series = Series(
        topic=Topic(TABLE, table.format, "", len(values)),
        stamps=np.zeros(len(times), dtype=np.int64),
        logged=times,
        columns={},
        refused={"without a time": missing} if missing else {},
    )
    everything = np.ones(len(times), dtype=bool)
    return Rows(index, series, Clocked(times, everything, 0, np.zeros(0)))


def _nanoseconds(values: Numbers, unit: int) -> IntArray:
    if values.dtype.kind == "i":  # an integer of ns has more digits than float64
        return values.astype(np.int64) * unit
    return np.rint(values * unit).astype(np.int64)


def table_tracks(mapping: RecordingMapping, table: Table, rows: Rows) -> RawTracks:
    """Returns the tracks of a table.

    Args:
        mapping: Mapping, checked against the table.
        table: The table.
        rows: Its rows.
    """
    everything = np.arange(len(rows.index))

    def of(*names: str) -> Track:
        values = np.stack([table.columns[name][rows.index] for name in names], axis=1)
        column = Column(everything, values.astype(np.float64))
        return track(rows.clock, column, slice(0, len(names)))

    def of_each(names: Mapping[str, str]) -> dict[str, Track]:
        return {part: of(name) for part, name in names.items()}

    def of_vectors(vectors: Mapping[str, Sequence[str]]) -> dict[str, Track]:
        return {key: of(*names) for key, names in vectors.items()}

    joints, commands = mapping.joints, mapping.commands
    return RawTracks(
        positions=of_each({hinge: link.name for hinge, link in joints.links.items()}),
        velocities=of_each(joints.velocities),
        efforts=of_each(joints.efforts),
        commands=of_each({motor: link.name for motor, link in commands.links.items()}),
        touch=of_each({name: touch.column for name, touch in mapping.touch.items()}),
        sensors=of_each(mapping.sensors),
        base={} if mapping.base is None else of_vectors(mapping.base.columns),
        imu={} if mapping.imu is None else of_vectors(mapping.imu.columns),
    )
