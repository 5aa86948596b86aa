"""Sections of the trials: each observed and as predicted, its displacement and its contacts."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.logs.results import TrialResult
from selfmodel.report import charts
from selfmodel.report.charts import Item, Section
from selfmodel.report.scene import Motion, Shot
from selfmodel.report.subject import Subject
from selfmodel.simulation.trial_replay import replay
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trial import Trial

MAX_DIAGRAMS = 12
"""Trials with a gait diagram, at most: the last ones."""


def shots_of(subject: Subject) -> tuple[Shot, ...]:
    """Returns every trial of a report with its simulations."""
    after = [("best hypothesis", subject.diagnosis.best)]
    if subject.runner_up is not None:
        after.append(("runner-up", subject.runner_up))
    before = [("self-model", INTACT)]
    return tuple(
        _shot(subject, trial, hypotheses)
        for trials, hypotheses in ((subject.healthy, before), (subject.damaged, after))
        for trial in trials
    )


def _shot(subject: Subject, trial: Trial, hypotheses: Sequence[tuple[str, Hypothesis]]) -> Shot:
    rollouts = []
    for name, hypothesis in hypotheses:
        result = replay(trial, hypothesis, subject.simulator)
        signals = {signal: result.simulated[signal] for signal in SIGNALS}
        behaviour = Behaviour(result.simulated.names, trial.behaviour.time, signals)
        rollouts.append(Motion(name, hypothesis, behaviour, result.diverged))
    change = subject.change_of(trial)
    mark = None if change is None else change[0]
    return Shot(subject.names[trial.path], trial, tuple(rollouts), mark)


def trials_section(subject: Subject, shots: Sequence[Shot]) -> Section:
    """Returns the section of the trials: displacement, predicted against observed."""
    text = (
        "A prediction is a simulation of the whole trial by the self-model, with the same "
        "controller, from its initial pose. Trials before the failure are predicted without a "
        "fault, all others under the hypotheses of the last diagnosis."
    )
    items: list[Item] = []
    if not subject.robot.has_fixed_base:
        items.append(
            charts.BarChart(
                title="Forward displacement of each trial, observed and predicted",
                x_label="forward displacement, m",
                names=("observed", "best hypothesis or self-model", "runner-up"),
                groups=tuple(charts.Group(one.name, _displacements(one)) for one in shots),
            )
        )
    items.append(_trials_table(subject, shots))
    return Section("trials", "Trials", (text,), tuple(items))


def _displacements(shot: Shot) -> tuple[float, ...]:
    predicted = [rollout.displacement for rollout in shot.rollouts]
    return (shot.trial.displacement, *(*predicted, math.nan)[:2])


def _trials_table(subject: Subject, shots: Sequence[Shot]) -> charts.Table:
    columns = ["trial", "stage", "steps", "observed displacement, m"]
    columns += ["predicted displacement, m", "predicted under"]
    result = subject.result
    results = {} if result is None else {one.name: one for one in result.trials or ()}
    if result is not None:
        columns += [f"{result.score.name}, {result.score.unit}".removesuffix(", ")]
        columns += ["predicted before the trial", "hypothesis at the time", "fell at step"]
    rows = []
    for one in shots:
        first = one.rollouts[0]
        row: list[charts.Cell] = [one.name, one.trial.plan.stage, one.trial.behaviour.steps]
        row += [one.trial.displacement, first.displacement, str(first.hypothesis)]
        row += [] if result is None else _scores(results.get(one.name))
        rows.append(tuple(row))
    return charts.Table("Trials", tuple(columns), tuple(rows))


def _scores(found: TrialResult | None) -> list[charts.Cell]:
    if found is None:
        return [None] * 4
    return [found.score, found.predicted_score, found.hypothesis, found.fell_at_step]


def gait_section(subject: Subject, shots: Sequence[Shot]) -> Section | None:
    """Returns the section of the gait, contacts over time; None without touch sensors."""
    sensors = subject.robot.anatomy.sensors
    touch = {one.name: i for i, one in enumerate(sensors) if one.kind == "touch"}
    diagrams = tuple(_diagram(one, touch) for one in shots[-MAX_DIAGRAMS:] if touch)
    shown = tuple(one for one in diagrams if one.groups)
    text = (
        "A bar is the time in which a touch sensor has contact (after Hildebrand, 1965). The "
        "sensors of a detached limb have none."
    )
    return Section("gait", "Gait diagram", (text,), shown) if shown else None


def _diagram(shot: Shot, touch: dict[str, int]) -> charts.GaitDiagram:
    motions = [("measured", shot.trial.behaviour)]
    motions += [(one.name, one.behaviour) for one in shot.rollouts[:1] if not one.diverged]
    return charts.GaitDiagram(
        title=f"Contacts in {shot.name}",
        groups={
            name: tuple(
                charts.Lane(sensor, tuple(_spans(behaviour.time, behaviour["sensors"][:, i])))
                for sensor, i in touch.items()
            )
            for name, behaviour in motions
            if np.isfinite(behaviour["sensors"][:, list(touch.values())]).any()
        },
        end=float(shot.trial.behaviour.time[-1]),
    )


def _spans(time: FloatArray, readings: FloatArray) -> Iterator[tuple[float, float]]:
    """Yields the times from the first step with contact to the first without."""
    contact = np.concatenate([[False], readings > 0.5, [False]])
    edges = np.flatnonzero(contact[1:] != contact[:-1])
    for begin, end in edges.reshape(-1, 2):
        yield float(time[begin]), float(time[min(end, len(time) - 1)])
