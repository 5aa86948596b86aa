"""Section of the residual: loss over time by hypothesis, by signal and by sensor."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.report.charts import HeatMap, Item, LineChart, Mark, Row, Series
from selfmodel.report.document import Section
from selfmodel.report.sensor_errors import SensorErrors, sensor_errors
from selfmodel.report.subject import Subject

TIME = "time, s, with the trials one after the other"

STRONGEST_QUANTILE = 0.98
"""Share of the errors in a heat map below its strongest colour."""


TEXT = (
    "The trials to explain are predicted piece by piece. A loss that stays as low as on the "
    "healthy robot is explained; a loss that rises at one time shows a change of the robot."
)


@dataclass(frozen=True, eq=False)
class Axis:
    """Time axis of all trials, one after the other.

    Attributes:
        offset: Beginning of each trial on the axis, s, by the path of its log.
        marks: Beginnings of the trials, and the time of a change.
    """

    offset: dict[str, float]
    marks: tuple[Mark, ...]


def residual_section(subject: Subject) -> Section | None:
    """Returns the section of the residual; None if the comparator has no losses over time."""
    axis = _axis(subject)
    items = [*_loss_charts(subject, axis), *_heat_map(subject, axis)]
    if not items:
        return None
    text = [TEXT]
    change = subject.diagnosis.change
    if change is not None:
        text.append(
            f"The robot changed at about t = {change.time:.1f} s ({change.earliest:.1f} to "
            f"{change.latest:.1f}) of {subject.names[subject.damaged[change.index].path]}; before: "
            f"{change.before}."
        )
    return Section("residual", "Residual over time", tuple(text), tuple(items))


def _axis(subject: Subject) -> Axis:
    offset: dict[str, float] = {}
    marks: list[Mark] = []
    now = 0.0
    for trial in subject.damaged:
        offset[trial.path] = now
        marks.append(Mark(subject.names[trial.path], now))
        change = subject.change_of(trial)
        if change is not None:
            time, low, high = (now + one for one in change)
            marks.append(Mark("change of the robot", time, low, high))
        now += float(trial.behaviour.time[-1]) + subject.robot.control_timestep
    return Axis(offset, tuple(marks))


def _loss_charts(subject: Subject, axis: Axis) -> list[Item]:
    evidence, trials = subject.evidence, subject.damaged
    timeline = evidence.timeline(trials)
    if timeline is None:
        return []
    begin = np.array([axis.offset[trials[int(i)].path] for i in timeline.trial])
    middle = begin + (timeline.begin + timeline.end) / 2
    shown = subject.shown_hypotheses
    losses = evidence.losses([one for _, one in shown], trials)
    by_signal = evidence.pieces_by_signal(subject.diagnosis.best, trials)
    found: list[Item] = [
        LineChart(
            "Loss over time of each hypothesis",
            TIME,
            "loss of a piece",
            tuple(_series(name, middle, row) for (name, _), row in zip(shown, losses, strict=True)),
            axis.marks,
        )
    ]
    if by_signal:
        found.append(
            LineChart(
                f"Loss over time by signal, of {subject.diagnosis.best}",
                TIME,
                "part of the loss of a piece",
                tuple(_series(name, middle, row) for name, row in by_signal.items()),
                axis.marks,
            )
        )
    return found


def _series(name: str, x: FloatArray, y: FloatArray) -> Series:
    return Series(name, tuple(map(float, x)), tuple(map(float, y)))


def _heat_map(subject: Subject, axis: Axis) -> list[Item]:
    best = subject.diagnosis.best
    found = [(trial, sensor_errors(subject, trial, best)) for trial in subject.damaged]
    known = [(axis.offset[trial.path], one) for trial, one in found if one is not None]
    if not known:
        return []
    errors = np.concatenate([one.errors for _, one in known], axis=1)
    finite = errors[np.isfinite(errors)]
    largest = float(np.quantile(finite, STRONGEST_QUANTILE)) if finite.size else 1.0
    return [
        HeatMap(
            title=f"Error by sensor over time, of {best}",
            x_label=TIME,
            value_label="root mean square error, 1: large",
            begin=_times(known, "begin"),
            end=_times(known, "end"),
            rows=tuple(
                Row(name, tuple(map(float, row)))
                for name, row in zip(known[0][1].names, errors, strict=True)
            ),
            largest=max(largest, 1.0),
            marks=axis.marks,
        )
    ]


def _times(known: Sequence[tuple[float, SensorErrors]], side: str) -> tuple[float, ...]:
    times = (offset + getattr(one, side) for offset, one in known)
    return tuple(float(time) for row in times for time in row)
