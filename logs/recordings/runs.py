"""Runs of a recording: its parts between restarts of the clock, each with times that increase."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from selfmodel.errors import InputError
from selfmodel.logs.recordings.recording import Column, IntArray, Recording, Series
from selfmodel.logs.recordings.resample import Clocked

_SUCCESSION = 10
"""Samples in order, all before the latest earlier one, with which a run begins: fewer are late."""

_MIN_RETURN = 10**9
"""Time by which a clock goes back that restarts, ns, or half a run if that is less."""


def chosen_run(
    path: Path, recording: Recording, clocks: Mapping[str, Clocked], run: int | None
) -> Recording:
    """Returns one run of a recording, by the clocks of the topics that are used.

    A topic with too few messages to show a restart has it where the first of the others has it.

    Raises:
        InputError: There are several runs and none is chosen, or there is no run of that number.
    """
    found = {}  # places in the recording of the messages with which the clock of a topic restarts
    for topic, clock in clocks.items():
        usable = np.flatnonzero(clock.usable)
        first_ones = usable[[*restarts(clock.times[usable])]]
        found[topic] = recording.series[topic].places[first_ones]
    most = max(map(len, found.values()))
    if not most and run in (None, 1):
        return recording
    first = np.min([borders for borders in found.values() if len(borders) == most], axis=0)
    parts: list[dict[str, Series]] = [{} for _ in range(most + 1)]
    seconds = np.zeros(most + 1)
    for topic, clock in clocks.items():
        series = recording.series[topic]
        borders = found[topic] if len(found[topic]) == most else first
        edges = [0, *np.searchsorted(series.places, borders).tolist(), len(series.places)]
        for number, (start, end) in enumerate(pairwise(edges)):
            parts[number][topic] = _part(series, start, end)
            times = clock.times[start:end][clock.usable[start:end]]
            seconds[number] = max(seconds[number], np.ptp(times) / 1e9 if len(times) else 0.0)
    lengths = f"{len(parts)} runs of {', '.join(f'{length:.3f}' for length in seconds)} s"
    if run is not None and run <= len(parts):
        note = f"the clock restarts: this is run {run} of {lengths}"
        series_of_run = {**recording.series, **parts[run - 1]}
        return replace(recording, series=series_of_run, notes=(*recording.notes, note))
    given = "" if run is None else f", got --run {run}"
    if not most:
        raise InputError(f"{path}: its clock does not restart: leave out --run{given}")
    raise InputError(
        f"{path}: its clock restarts, so there are {lengths}: choose one, such as --run 1{given}"
    )


def restarts(times: IntArray) -> Iterator[int]:
    """Yields the places at which the clock of a topic restarts, in the order of the recording."""
    if len(times) <= _SUCCESSION:
        return
    forward = np.diff(times) >= 0
    in_order = np.asarray(np.all(sliding_window_view(forward, _SUCCESSION - 1), axis=1))
    latest_after = np.maximum.accumulate(times[::-1])[::-1]
    start = seen = 0
    earliest = latest = times[0]
    candidates = np.flatnonzero(~forward[: len(in_order) - 1] & in_order[1:]) + 1
    for place in candidates.tolist():
        # Without the sample before it, which may be a single wrong one.
        before, seen = times[seen : place - 1], place - 1
        if seen <= start:
            continue
        earliest, latest = min(earliest, before.min()), max(latest, before.max())
        back = min(_MIN_RETURN, (latest - earliest) // 2)
        returns = times[place] < latest - back and times[place + _SUCCESSION - 1] < latest
        # Parts in the wrong order, of which the second ends as the first begins, are sorted.
        if returns and not -_MIN_RETURN < latest_after[place] - earliest < 0:
            yield place
            start = seen = place
            earliest = latest = times[place]


def _part(series: Series, start: int, end: int) -> Series:
    """Messages of a topic from one to another, not included."""
    columns = {}
    for name, column in series.columns.items():
        first, last = np.searchsorted(column.index, [start, end])
        columns[name] = Column(column.index[first:last] - start, column.values[first:last])
    return replace(
        series,
        count=end - start,
        stamps=series.stamps[start:end],
        logged=series.logged[start:end],
        places=series.places[start:end],
        columns=columns,
    )
