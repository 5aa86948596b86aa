"""Sections of the evidence: loss over time and by sensor, and what cannot be distinguished."""

import numpy as np

from selfmodel.arrays import FloatArray, mean_of_known
from selfmodel.controllers.controller import CommandSource, Controller
from selfmodel.diagnosis.choice import prepared_trial
from selfmodel.diagnosis.losses import simulate
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.logs.controllers import controller_bytes
from selfmodel.recovery.next_trial import (
    EARLY_STEPS,
    candidates_to_separate,
    disagreements_on,
    discriminating_controller,
)
from selfmodel.report import charts
from selfmodel.report.charts import Item, Section
from selfmodel.report.subject import Subject
from selfmodel.settings import Settings
from selfmodel.simulation.requests import ClosedLoop, Segments
from selfmodel.trials.signals import PREDICTION_ERROR_SCALES, Signal, difference
from selfmodel.trials.trial import Trial

TIME = "time, s, with the trials one after the other"

RESIDUAL = (
    "The trials to explain are predicted piece by piece. A loss that stays as low as on the "
    "healthy robot is explained; a loss that rises at one time shows a change of the robot."
)

STRONGEST_QUANTILE = 0.98
"""Share of the errors in a heat map below its strongest colour."""

SHOWN: tuple[tuple[Signal, str], ...] = (("sensors", ""), ("joint_positions", "encoder "))
"""Signals whose columns are sensors, with the beginning of their names."""

WINDOWS = 80
"""Windows of a trial that is simulated as a whole, at most."""

POPULATION, SEED = 20, 0
"""Controllers per generation in the choice of a separating trial, where a recovery takes the
paper's 100, and seed of the choice."""

FILE = "separating.npz"
"""Name of the file of the separating controller."""


def residual_section(subject: Subject) -> Section | None:
    """Returns the section of the residual; None if the comparator has no losses over time."""
    begins, marks = _axis(subject)
    items = [*_loss_charts(subject, begins, marks), *_heat_map(subject, begins, marks)]
    if not items:
        return None
    text = [RESIDUAL]
    change = subject.diagnosis.change
    if change is not None:
        text.append(
            f"The robot changed at about t = {change.time:.1f} s ({change.earliest:.1f} to "
            f"{change.latest:.1f}) of {subject.names[subject.damaged[change.index].path]}; before: "
            f"{change.before}."
        )
    return Section("residual", "Residual over time", tuple(text), tuple(items))


def _axis(subject: Subject) -> tuple[FloatArray, tuple[charts.Mark, ...]]:
    """Returns where each trial begins, s, one after the other, and marks there and at a change."""
    step, marks = subject.robot.control_timestep, list[charts.Mark]()
    lengths = [float(trial.trajectory.time[-1]) + step for trial in subject.damaged]
    begins = np.cumsum([0.0, *lengths[:-1]])
    for trial, begin in zip(subject.damaged, begins.tolist(), strict=True):
        marks.append(charts.Mark(subject.names[trial.path], begin))
        if (change := subject.change_of(trial)) is not None:
            marks.append(charts.Mark("change of the robot", *(begin + time for time in change)))
    return begins, tuple(marks)


def _loss_charts(
    subject: Subject, begins: FloatArray, marks: tuple[charts.Mark, ...]
) -> list[Item]:
    table, trials = subject.losses, subject.damaged
    timeline = table.timeline(trials)
    if timeline is None:
        return []
    middles = begins[timeline.trial] + (timeline.begin + timeline.end) / 2
    middle = tuple(middles.tolist())
    names, hypotheses = zip(*subject.shown_hypotheses, strict=True)
    best = subject.diagnosis.best
    losses = dict(zip(names, table.losses(hypotheses, trials), strict=True))
    by_signal = table.by_signal(best, trials)
    return [
        charts.LineChart(
            title,
            TIME,
            y_label,
            tuple(charts.Series(name, middle, tuple(row.tolist())) for name, row in rows.items()),
            marks,
        )
        for title, y_label, rows in (
            ("Loss over time of each hypothesis", "loss of a piece", losses),
            (f"Loss over time by signal, of {best}", "part of the loss of a piece", by_signal),
        )
        if rows
    ]


def _heat_map(subject: Subject, begins: FloatArray, marks: tuple[charts.Mark, ...]) -> list[Item]:
    best = subject.diagnosis.best
    by_trial = [sensor_errors(subject, trial, best) for trial in subject.damaged]
    known = [(at, one) for at, one in zip(begins, by_trial, strict=True) if one is not None]
    if not known:
        return []
    names = known[0][1][0]
    errors = np.concatenate([one[2] for _, one in known], axis=1)
    begins, ends = (np.concatenate([times[k] + at for at, (_, times, _) in known]) for k in (0, 1))
    finite = errors[np.isfinite(errors)]
    largest = float(np.quantile(finite, STRONGEST_QUANTILE)) if finite.size else 1.0
    rows = zip(names, errors, strict=True)
    return [
        charts.HeatMap(
            title=f"Error by sensor over time, of {best}",
            x_label=TIME,
            value_label="root mean square error, 1: large",
            begin=tuple(begins.tolist()),
            end=tuple(ends.tolist()),
            rows=tuple(charts.Group(name, tuple(row.tolist())) for name, row in rows),
            largest=max(largest, 1.0),
            marks=marks,
        )
    ]


def sensor_errors(
    subject: Subject, trial: Trial, hypothesis: Hypothesis
) -> tuple[list[str], FloatArray, FloatArray] | None:
    """Returns the errors of a hypothesis on a trial by sensor and window.

    The predictions are those of the comparator: short ones from logged states, or one simulation of
    the whole trial. The result is None if the simulation diverges, or for an ensemble; or else the
    names of the sensors; beginning and end of each window, s since the start of the trial,
    ``(2, windows)``; root mean square errors in units of ``PREDICTION_ERROR_SCALES``,
    ``(sensors, windows)``, NaN where nothing was observed.
    """
    robot, trajectory = subject.simulator.robot, trial.trajectory
    request = prepared_trial(subject.comparator, robot, trial).request
    result = simulate(subject.simulator, request, trial, [hypothesis])
    if result.diverged.any():
        return None
    if isinstance(request, Segments):
        rows = request.starts[:, np.newaxis] + np.arange(request.horizon + 1)
    elif isinstance(request, ClosedLoop):
        count = min(WINDOWS, trajectory.steps)
        rows = np.arange(trajectory.steps // count * count).reshape(count, -1)
    else:
        return None
    names: list[str] = []
    errors: list[FloatArray] = []
    for signal, prefix in SHOWN:
        if signal in result.trajectory.signals:
            predicted = result.trajectory[signal][0]
            predicted = predicted if isinstance(request, Segments) else predicted[rows]
            error = difference(signal, predicted, trajectory[signal][rows])
            squares = (error / PREDICTION_ERROR_SCALES[signal]) ** 2
            errors.append(np.sqrt(mean_of_known(squares, axis=1, empty=np.nan)).T)
            names += [f"{prefix}{name}" for name in trajectory.names.columns(signal)]
    if not errors:
        return None
    return names, trajectory.time[rows[:, [0, -1]]].T, np.concatenate(errors)


def separation_section(subject: Subject) -> Section:
    """Returns the section of the alternatives to the best hypothesis."""
    diagnosis, title = subject.diagnosis, "What cannot be distinguished"
    if not diagnosis.indistinguishable and not diagnosis.undetectable:
        text = "No other hypothesis predicts the trials as well, and no fault is undetectable."
        return Section("separation", title, (text,))
    reasons = [(one, "predicts the trials as well") for one in diagnosis.indistinguishable]
    reasons += [
        (one, "its further fault does not show in these trials") for one in diagnosis.undetectable
    ]
    text = "These hypotheses predict the trials as well as the best one, or nearly so."
    advice = (
        "A trial separates hypotheses if their predictions of it differ; a disagreement of 1 is "
        "complete."
    )
    table = charts.Table.of(
        "Hypotheses that cannot be distinguished from the best",
        [{"hypothesis": str(one), "reason": reason} for one, reason in reasons],
    )
    return Section("separation", title, (text, advice), (table, *_separating_trials(subject)))


def _separating_trials(subject: Subject) -> tuple[Item, ...]:
    """Returns the disagreement of the hypotheses by trial, and a controller evolved for it."""
    apart, simulator = candidates_to_separate(subject.diagnosis), subject.simulator
    drivers: dict[str, CommandSource] = {
        subject.names[trial.path]: trial.plan.controller for trial in subject.damaged
    }
    steps = min(trial.trajectory.steps for trial in subject.damaged)
    separating = _separating_controller(subject, steps)
    if separating is not None:
        drivers["a separating trial"] = separating
    early = min(steps, EARLY_STEPS)
    runs = [(apart[0], driver) for driver in drivers.values()]
    commands = simulator.run(runs, early, ("commands",)).trajectory["commands"]
    values = disagreements_on(commands, apart, simulator).tolist()
    chart = charts.BarChart(
        title="Disagreement of these hypotheses by trial",
        x_label=f"disagreement in the first {early} steps, from 0 to 1",
        names=("disagreement",),
        groups=tuple(
            charts.Group(name, (value,)) for name, value in zip(drivers, values, strict=True)
        ),
    )
    if separating is None:
        return (chart,)
    title = f"the controller of a separating trial, for selfmodel trial --controller {FILE}"
    return chart, charts.Attachment(title, FILE, controller_bytes(separating))


def _separating_controller(subject: Subject, steps: int) -> Controller | None:
    """Returns a controller evolved to separate the hypotheses; None without one that can evolve."""
    drivers = [trial.plan.controller for trial in reversed(subject.damaged)]
    newest_first = [
        one for one in dict.fromkeys(drivers) if isinstance(one, Controller) and len(one.genome)
    ]
    if not newest_first or steps < 2:
        return None
    settings, rng = Settings(steps=steps).scaled(POPULATION), np.random.default_rng(SEED)
    return discriminating_controller(
        subject.diagnosis, newest_first, subject.simulator, settings, rng
    )
