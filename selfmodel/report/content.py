"""Content of a report: its first sentences and its sections, from a subject."""

import dataclasses
import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.diagnosis.text import (
    fit_sentence,
    right_or_wrong,
    summary,
    verdict_sentences,
)
from selfmodel.errors import counted
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.logs.results import RecoveryResult, Search
from selfmodel.recovery.falls import fall_of, fall_text
from selfmodel.recovery.scores import DISPLACEMENT, UPRIGHT, score_label, value_text
from selfmodel.report import charts
from selfmodel.report.charts import Item, Report, Section
from selfmodel.report.evidence import residual_section, separation_section
from selfmodel.report.scene import Motion, Shot, scene_of
from selfmodel.report.subject import Subject
from selfmodel.robot.robot import Robot
from selfmodel.simulation.calibration import UNDETERMINED, Calibration
from selfmodel.simulation.trial_replay import replay
from selfmodel.trials.trial import Trial

NOT_FINISHED = "The recovery is not finished"
"""Beginning of the headline of a recovery that goes on, or that was interrupted."""

MAX_LINES = 4
"""Hypotheses in the chart over diagnoses."""

MAX_DIAGRAMS = 12
"""Trials with a gait diagram, at most: the last ones."""

TRIAL_COLUMNS = {
    "predicted before the trial": "predicted_score",
    "mean of its repair": "robust_mean",
    "hypothesis at the time": "hypothesis",
    "fell at step": "fell_at_step",
}
"""Further columns of the table of trials of a recovery, and the fields of their results."""

Z = 1.96
"""Half width of a 95 % interval of a normal distribution, in standard deviations."""


def report_of(subject: Subject, *, finished: bool = True) -> Report:
    """Returns the report of trials and their diagnoses, of a recovery that is finished or not."""
    shots = shots_of(subject)
    sections = [
        trials_section(subject, shots),
        hypotheses_section(subject),
        residual_section(subject),
        separation_section(subject),
        searches_section(subject.searches),
        calibration_section(subject.calibration),
        gait_section(subject, shots),
    ]
    sentence = headline(subject)
    return Report(
        title=subject.title,
        headline=sentence if finished else f"{NOT_FINISHED}: {sentence}",
        verdict=details(subject),
        sections=tuple(section for section in sections if section is not None),
        scene=scene_of(subject.robot, shots),
        made_with=subject.made_with,
    )


def headline(subject: Subject) -> str:
    """Returns what happened, in a few sentences."""
    result, (what, _) = subject.result, summary(subject.diagnosis)
    if result is None:
        trials = counted(len(subject.damaged), "trial")
        return f"{trials} of the {subject.robot.name}. {what}"
    score = result.score
    before, after, recovered = (
        value_text(value, score.unit, score.most)
        for value in (score.before, score.after, score.recovered)
    )
    is_distance = score.name in (DISPLACEMENT.name, UPRIGHT.name)
    name, achieved = ("", "moved") if is_distance else (f" ({score.name})", "scored")
    fall = ", and fell, which is no recovery" if result.fell else ""
    return (
        f"The {subject.robot.name} {achieved} {before}{name} before the failure and {after} after "
        f"it. {what} The robot {achieved} {recovered} at best in "
        f"{counted(result.physical_trials, 'trial')} since{fall}."
    )


def details(subject: Subject) -> tuple[str, ...]:
    """Returns what to do, the sentences of the verdict, and the truth where it is known."""
    diagnosis, result = subject.diagnosis, subject.result
    sentences = [summary(diagnosis)[1], verdict_sentences(diagnosis), fit_sentence(diagnosis)]
    if result is not None:
        sentences += [*(f"Warning: {one}." for one in result.warnings), _truth(result)]
    return tuple(sentence for sentence in sentences if sentence)


def _truth(result: RecoveryResult) -> str:
    gap = f", at a reality gap of {result.gap:g}" if result.gap else ""
    best = str(result.diagnosis[0]["hypothesis"])
    judgement = right_or_wrong(best, result.truth, correct=result.correct)
    return f"True faults: {result.truth}{gap}; the diagnosis is {judgement}."


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
        trajectory = dataclasses.replace(result.simulated, time=trial.trajectory.time)
        rollouts.append(Motion(name, hypothesis, trajectory, result.diverged))
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
    items = _score_chart(subject.result) if subject.result is not None else []
    if not subject.robot.has_fixed_base:
        items.append(
            charts.BarChart(
                title="Forward displacement of each trial, observed and predicted",
                x_label="forward displacement, m",
                names=("observed", "best hypothesis or self-model", "runner-up"),
                groups=tuple(_displacements(subject.robot, one) for one in shots),
            )
        )
    items.append(_trials_table(subject, shots))
    return Section("trials", "Trials", (text,), tuple(items))


def _score_chart(result: RecoveryResult) -> list[Item]:
    """Returns the chart of the score of each trial, unless that is the displacement."""
    score, trials = result.score, result.trials or ()
    if score.name == DISPLACEMENT.name or not trials:
        return []
    groups = [
        charts.Group(
            one.name,
            tuple(math.nan if it is None else it for it in (one.score, one.predicted_score)),
            (fall_text(one.fell_at_step)[2:],),
        )
        for one in trials
    ]
    return [
        charts.BarChart(
            title="Score of each trial, observed and predicted before the trial",
            x_label=score_label(score.name, score.unit, score.most),
            names=("observed", "predicted before the trial"),
            groups=tuple(groups),
        )
    ]


def _displacements(robot: Robot, shot: Shot) -> charts.Group:
    """Returns the bars of a trial, the first with its fall by the best hypothesis."""
    ways = [shot.trial.displacement, *(one.displacement for one in shot.rollouts), math.nan]
    fall = fall_of(robot, shot.rollouts[0].hypothesis, shot.trial)
    return charts.Group(shot.name, tuple(ways[:3]), (fall_text(fall)[2:],))


def _trials_table(subject: Subject, shots: Sequence[Shot]) -> charts.Table:
    result = subject.result
    results = {} if result is None else {one.name: one for one in result.trials or ()}
    rows = []
    for one in shots:
        first = one.rollouts[0]
        row: dict[str, charts.Cell] = {
            "trial": one.name,
            "stage": one.trial.plan.stage,
            "steps": one.trial.trajectory.steps,
            "observed displacement, m": one.trial.displacement,
            "predicted displacement, m": first.displacement,
            "predicted under": str(first.hypothesis),
        }
        if result is not None:
            score = score_label(result.score.name, result.score.unit)
            score = f"score: {score}" if score in row else score  # of a plug-in
            found = results.get(one.name)
            has_task = any(one.reward_sum is not None for one in results.values())
            task = {"return": "reward_sum"} if has_task else {}
            for title, name in {score: "score", **task, **TRIAL_COLUMNS}.items():
                row[title] = getattr(found, name, None)
        rows.append(row)
    return charts.Table.of("Trials", rows)


def hypotheses_section(subject: Subject) -> Section:
    """Returns the section of the hypotheses: the loss of each, and how it went over diagnoses."""
    diagnosis = subject.diagnosis
    ranked = [(one.hypothesis, one.distance) for one in diagnosis.ranked]
    if INTACT not in (one for one, _ in ranked):
        ranked.append((INTACT, diagnosis.intact_distance))
    chart = charts.BarChart(
        title="Loss of each hypothesis",
        x_label=f"distance by {subject.comparator.name}, summed over the trials",
        names=("distance",),
        groups=tuple(charts.Group(str(one), (distance,)) for one, distance in ranked),
    )
    columns = ("rank", "hypothesis", "distance", "probability", "against the best")
    known = {one: round(number, 2) for one, number in diagnosis.probability.items()}
    rows = tuple(
        (rank, str(one), distance, known.get(str(one)), _standing(diagnosis, one))
        for rank, (one, distance) in enumerate(ranked, start=1)
    )
    table = charts.Table("Hypotheses", columns, rows)
    items = (chart, table) if len(subject.diagnoses) < 2 else (chart, table, _over_time(subject))
    text = (
        f"The smaller the distance, the better the prediction. The first hypothesis has the fewest "
        f"faults, each of which improves the prediction significantly; a hypothesis with more "
        f"faults may have a smaller distance. Test: {diagnosis.test}."
    )
    return Section("hypotheses", "Hypotheses", (text,), items)


def _standing(diagnosis: Diagnosis, hypothesis: Hypothesis) -> str:
    if hypothesis == diagnosis.best:
        return "the best"
    if hypothesis in diagnosis.indistinguishable:
        return "cannot be distinguished"
    if hypothesis in diagnosis.undetectable:
        return "its further fault is undetectable"
    return "worse, or not better with more faults"


def _over_time(subject: Subject) -> charts.LineChart:
    """Returns the distance per trial of the hypotheses of the last diagnosis, by diagnosis."""
    counts = tuple(float(diagnosis.trials) for diagnosis in subject.diagnoses)
    lines = {"intact": tuple(one.intact_distance / one.trials for one in subject.diagnoses)}
    for hypothesis in (candidate.hypothesis for candidate in subject.diagnosis.ranked[:MAX_LINES]):
        lines[str(hypothesis)] = tuple(
            next((c.distance for c in one.ranked if c.hypothesis == hypothesis), math.nan)
            / one.trials
            for one in subject.diagnoses
        )
    return charts.LineChart(
        title="Distance per trial after each diagnosis",
        x_label="trials explained",
        y_label="distance per trial",
        series=tuple(charts.Series(name, counts, values) for name, values in lines.items()),
    )


def searches_section(searches: Sequence[Search]) -> Section | None:
    """Returns the section of the searches; None if their progress was not recorded."""
    shown = tuple(
        charts.LineChart(
            title=title,
            x_label="evaluations",
            y_label=y_label,
            series=tuple(
                charts.Series(
                    name=f"{number}. {one.hypothesis or 'diagnosis'}",
                    x=tuple(map(float, one.evaluations)),
                    y=one.best,
                )
                for number, one in enumerate((one for one in searches if one.kind == kind), start=1)
            ),
        )
        for kind, title, y_label in (
            ("repair", "Repair: best score by evaluations", "best score"),
            (
                "diagnostic",
                "Diagnosis: best fitness by evaluations",
                "best fitness, minus distance",
            ),
        )
        if any(one.kind == kind and one.best for one in searches)
    )
    text = "Each line is one search: a repair before a trial, or the diagnosis after it."
    return Section("searches", "Progress of the searches", (text,), shown) if shown else None


def calibration_section(fit: Calibration | None) -> Section | None:
    """Returns the section of the calibration: errors, and factors with intervals; None without."""
    if fit is None:
        return None
    error = charts.BarChart(
        title="Prediction error of the self-model on the healthy trials",
        x_label="root mean square error, in units of each signal's scale",
        names=("error",),
        groups=(charts.Group("before", (fit.error_before,)), charts.Group("after", (fit.error,))),
    )
    factors = charts.IntervalChart(
        title="Fitted factors, with 95 % intervals",
        x_label="factor of the nominal value (1: as in the model)",
        estimates=tuple(_estimate(row) for row in fit.rows()),
        reference=1.0,
    )
    delay = fit.parameters.delay
    steps = f"{delay:g} {'step' if delay == 1 else 'steps'}"
    explained = (
        f"The self-model was fitted to the trials before the failure; the chosen set of parameters "
        f"is {fit.chosen}, with a control delay of {steps}. The prior of each factor is 1 with a "
        f"wide interval: a factor whose interval is as wide is {UNDETERMINED}."
    )
    text = [explained, *fit.contacts]
    text += [str(fit.suspicion)] if fit.suspicion is not None else []
    return Section("calibration", "Calibration", tuple(text), (error, factors))


def _estimate(row: dict[str, Any]) -> charts.Estimate:
    value, deviation = row["factor"], row["deviation"]
    with np.errstate(over="ignore"):  # a deviation of a changed file may be of any size
        low, high = (float(value * np.exp(sign * Z * deviation)) for sign in (-1, 1))
    return charts.Estimate(row["name"], value, low, high, "" if row["determined"] else UNDETERMINED)


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
    motions = [("measured", shot.trial.trajectory)]
    motions += [(one.name, one.trajectory) for one in shot.rollouts[:1] if not one.diverged]
    return charts.GaitDiagram(
        title=f"Contacts in {shot.name}",
        groups={
            name: tuple(
                charts.Lane(sensor, tuple(_spans(trajectory.time, trajectory["sensors"][:, i])))
                for sensor, i in touch.items()
            )
            for name, trajectory in motions
            if np.isfinite(trajectory["sensors"][:, list(touch.values())]).any()
        },
        end=float(shot.trial.trajectory.time[-1]),
    )


def _spans(time: FloatArray, readings: FloatArray) -> Iterator[tuple[float, float]]:
    """Yields the times from the first step with contact to the first without."""
    contact = np.concatenate([[False], readings > 0.5, [False]])
    edges = np.flatnonzero(contact[1:] != contact[:-1])
    for begin, end in edges.reshape(-1, 2):
        yield float(time[begin]), float(time[min(end, len(time) - 1)])
