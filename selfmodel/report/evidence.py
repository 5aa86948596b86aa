"""Sections of the evidence: loss over time and by sensor, and what cannot be distinguished."""

import base64
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import CommandSource, Controller
from selfmodel.controllers.playback import Playback
from selfmodel.diagnosis.choice import prepared_trial
from selfmodel.diagnosis.losses import simulate
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.logs.controllers import controller_bytes
from selfmodel.recovery.next_trial import (
    EARLY_STEPS,
    candidates_to_separate,
    disagreements,
    discriminating_controller,
)
from selfmodel.report import charts
from selfmodel.report.charts import Item, Section
from selfmodel.report.subject import Subject
from selfmodel.settings import Settings
from selfmodel.simulation.requests import ClosedLoop, Segments
from selfmodel.trials.signals import (
    DISAGREEMENT_SCALES,
    PREDICTION_ERROR_SCALES,
    Signal,
    difference,
)
from selfmodel.trials.trial import Trial

TIME = "time, s, with the trials one after the other"

STRONGEST_QUANTILE = 0.98
"""Share of the errors in a heat map below its strongest colour."""


SHOWN: tuple[tuple[Signal, str], ...] = (("sensors", ""), ("joint_positions", "encoder "))
"""Signals whose columns are sensors, with the beginning of their names."""

WINDOWS = 80
"""Windows of a trial that is simulated as a whole, at most."""

TEXT = (
    "The trials to explain are predicted piece by piece. A loss that stays as low as on the "
    "healthy robot is explained; a loss that rises at one time shows a change of the robot."
)


POPULATION = 20
"""Controllers per generation in the choice of the trial; a recovery takes the paper's 100."""

FILE = "separating.npz"

SEED = 0
"""Seed of the choice of the trial."""


@dataclass(frozen=True, eq=False)
class Axis:
    """Time axis of all trials, one after the other.

    Attributes:
        offset: Beginning of each trial on the axis, s, by the path of its log.
        marks: Beginnings of the trials, and the time of a change.
    """

    offset: dict[str, float]
    marks: tuple[charts.Mark, ...]


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
    marks: list[charts.Mark] = []
    now = 0.0
    for trial in subject.damaged:
        offset[trial.path] = now
        marks.append(charts.Mark(subject.names[trial.path], now))
        change = subject.change_of(trial)
        if change is not None:
            time, low, high = (now + one for one in change)
            marks.append(charts.Mark("change of the robot", time, low, high))
        now += float(trial.behaviour.time[-1]) + subject.robot.control_timestep
    return Axis(offset, tuple(marks))


def _loss_charts(subject: Subject, axis: Axis) -> list[Item]:
    table, trials = subject.losses, subject.damaged
    timeline = table.timeline(trials)
    if timeline is None:
        return []
    begin = np.array([axis.offset[trials[int(i)].path] for i in timeline.trial])
    middle = begin + (timeline.begin + timeline.end) / 2
    shown = subject.shown_hypotheses
    losses = table.losses([one for _, one in shown], trials)
    by_signal = table.by_signal(subject.diagnosis.best, trials)
    found: list[Item] = [
        charts.LineChart(
            "Loss over time of each hypothesis",
            TIME,
            "loss of a piece",
            tuple(_series(name, middle, row) for (name, _), row in zip(shown, losses, strict=True)),
            axis.marks,
        )
    ]
    if by_signal:
        found.append(
            charts.LineChart(
                f"Loss over time by signal, of {subject.diagnosis.best}",
                TIME,
                "part of the loss of a piece",
                tuple(_series(name, middle, row) for name, row in by_signal.items()),
                axis.marks,
            )
        )
    return found


def _series(name: str, x: FloatArray, y: FloatArray) -> charts.Series:
    return charts.Series(name, tuple(map(float, x)), tuple(map(float, y)))


def _heat_map(subject: Subject, axis: Axis) -> list[Item]:
    best = subject.diagnosis.best
    found = [(trial, sensor_errors(subject, trial, best)) for trial in subject.damaged]
    known = [
        (one.begin + axis.offset[trial.path], one.end + axis.offset[trial.path], one)
        for trial, one in found
        if one is not None
    ]
    if not known:
        return []
    errors = np.concatenate([one.errors for *_, one in known], axis=1)
    finite = errors[np.isfinite(errors)]
    largest = float(np.quantile(finite, STRONGEST_QUANTILE)) if finite.size else 1.0
    begins, ends, every = zip(*known, strict=True)
    rows = zip(every[0].names, errors, strict=True)
    return [
        charts.HeatMap(
            title=f"Error by sensor over time, of {best}",
            x_label=TIME,
            value_label="root mean square error, 1: large",
            begin=tuple(np.concatenate(begins).tolist()),
            end=tuple(np.concatenate(ends).tolist()),
            rows=tuple(charts.Row(name, tuple(row.tolist())) for name, row in rows),
            largest=max(largest, 1.0),
            marks=axis.marks,
        )
    ]


@dataclass(frozen=True, eq=False)
class SensorErrors:
    """Root mean square errors by sensor and window.

    Attributes:
        names: Names of the sensors.
        begin: Beginning of each window, s since the start of the trial, ``(windows,)``.
        end: End of each window, likewise.
        errors: Errors in units of ``PREDICTION_ERROR_SCALES``, ``(sensors, windows)``; NaN where
            nothing was observed.
    """

    names: tuple[str, ...]
    begin: FloatArray
    end: FloatArray
    errors: FloatArray


def sensor_errors(subject: Subject, trial: Trial, hypothesis: Hypothesis) -> SensorErrors | None:
    """Returns the errors of a hypothesis on a trial.

    The predictions are those of the comparator: short ones from logged states, or one simulation of
    the whole trial. The result is None if the simulation diverges, or for an ensemble.
    """
    robot, behaviour = subject.simulator.robot, trial.behaviour
    request = prepared_trial(subject.comparator, robot, trial).request
    result = simulate(subject.simulator, request, trial, [hypothesis])
    if result.diverged.any():
        return None
    if isinstance(request, Segments):
        rows = request.starts[:, np.newaxis] + np.arange(request.horizon + 1)
    elif isinstance(request, ClosedLoop):
        count = min(WINDOWS, behaviour.steps)
        rows = np.arange(behaviour.steps // count * count).reshape(count, -1)
    else:
        return None
    found: list[FloatArray] = []
    names: list[str] = []
    for signal, prefix in SHOWN:
        if signal not in result.behaviour.signals:
            continue
        predicted = result.behaviour[signal][0]
        predicted = predicted if isinstance(request, Segments) else predicted[rows]
        error = difference(signal, predicted, behaviour[signal][rows])
        found.append(_rms(error / PREDICTION_ERROR_SCALES[signal]))
        names += [f"{prefix}{name}" for name in behaviour.names.columns(signal)]
    if not found:
        return None
    time = behaviour.time[rows]
    return SensorErrors(tuple(names), time[:, 0], time[:, -1], np.concatenate(found))


def _rms(errors: FloatArray) -> FloatArray:
    """Returns the root mean square over the steps of windows, ``(columns, windows)``."""
    known = np.isfinite(errors)
    counts = known.sum(axis=1)
    squares = np.where(known, errors, 0.0) ** 2
    mean = np.full(counts.shape, np.nan)
    np.divide(squares.sum(axis=1), counts, out=mean, where=counts > 0)
    return np.asarray(np.sqrt(mean).T)


def separation_section(subject: Subject) -> Section:
    """Returns the section of the alternatives to the best hypothesis."""
    diagnosis = subject.diagnosis
    if not diagnosis.indistinguishable and not diagnosis.undetectable:
        text = "No other hypothesis predicts the trials as well, and no fault is undetectable."
        return Section("separation", "What cannot be distinguished", (text,))
    text = "These hypotheses predict the trials as well as the best one, or nearly so."
    listed = charts.Table(
        "Hypotheses that cannot be distinguished from the best",
        ("hypothesis", "reason"),
        tuple(
            (str(one), reason)
            for found, reason in (
                (diagnosis.indistinguishable, "predicts the trials as well"),
                (diagnosis.undetectable, "its further fault does not show in these trials"),
            )
            for one in found
        ),
    )
    found = _trials(subject, candidates_to_separate(diagnosis))
    advice = (
        "A trial separates hypotheses if their predictions of it differ; a disagreement of 1 is "
        "complete."
    )
    return Section("separation", "What cannot be distinguished", (text, advice), (listed, *found))


def _trials(subject: Subject, apart: Sequence[Hypothesis]) -> tuple[Item, ...]:
    """Returns the disagreement of the hypotheses by trial, and a controller evolved for it."""
    drivers: dict[str, CommandSource] = {
        subject.names[trial.path]: trial.plan.controller for trial in subject.damaged
    }
    steps = min(trial.behaviour.steps for trial in subject.damaged)
    separating = _separating(subject, steps)
    if separating is not None:
        drivers["a separating trial"] = separating
    found = _disagreement(subject, apart, list(drivers.values()), steps)
    chart = charts.BarChart(
        title="Disagreement of these hypotheses by trial",
        x_label=f"disagreement in the first {min(steps, EARLY_STEPS)} steps, from 0 to 1",
        names=("disagreement",),
        groups=tuple(
            charts.Group(name, (float(value),)) for name, value in zip(drivers, found, strict=True)
        ),
    )
    if separating is None:
        return (chart,)
    data = base64.b64encode(controller_bytes(separating)).decode("ascii")
    title = f"the controller of a separating trial, for selfmodel trial --controller {FILE}"
    return chart, charts.Attachment(title, FILE, data)


def _separating(subject: Subject, steps: int) -> Controller | None:
    """Returns a controller evolved to separate the hypotheses; None for recordings alone."""
    drivers = [trial.plan.controller for trial in subject.damaged]
    evolved = [one for one in drivers if isinstance(one, Controller)]
    if not evolved or steps < 2:
        return None
    newest_first = list(dict.fromkeys(reversed(evolved)))
    settings = Settings(steps=steps).scaled(POPULATION)
    rng = np.random.default_rng(SEED)
    return discriminating_controller(
        subject.diagnosis, newest_first, subject.simulator, settings, rng
    )


def _disagreement(
    subject: Subject,
    apart: Sequence[Hypothesis],
    drivers: Sequence[CommandSource],
    steps: int,
) -> FloatArray:
    """Returns the disagreement on the commands of each driver under the best hypothesis."""
    early = min(steps, EARLY_STEPS)
    alone = [(apart[0], driver) for driver in drivers]
    first = subject.simulator.run(alone, early, ("commands",)).behaviour
    commands = [Playback(first.names.motors, rows) for rows in first["commands"]]
    runs = [(hypothesis, rows) for rows in commands for hypothesis in apart]
    outcome = subject.simulator.run(runs, early, tuple(DISAGREEMENT_SCALES))
    grouped = outcome.grouped(len(drivers), len(apart))
    with np.errstate(invalid="ignore", over="ignore"):  # values of a diverged simulation
        found = disagreements(grouped.behaviour)
    return np.where(grouped.diverged.any(axis=1), np.nan, found)
