"""Section of indistinguishable hypotheses, and of the trial that would separate them."""

import base64
from collections.abc import Sequence

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import CommandSource, Controller
from selfmodel.controllers.playback import Playback
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.logs.controllers import controller_bytes
from selfmodel.recovery.disagreement import EARLY_STEPS, disagreements
from selfmodel.recovery.next_trial import candidates_to_separate, discriminating_controller
from selfmodel.report.charts import Attachment, BarChart, Group, Table
from selfmodel.report.document import Section
from selfmodel.report.subject import Subject
from selfmodel.settings import Settings
from selfmodel.trials.signals import DISAGREEMENT_SCALES

POPULATION = 20
"""Controllers per generation in the choice of the trial; a recovery takes the paper's 100."""

FILE = "separating.npz"

SEED = 0
"""Seed of the choice of the trial."""


def separation_section(subject: Subject) -> Section:
    """Returns the section of the alternatives to the best hypothesis."""
    diagnosis = subject.diagnosis
    if not diagnosis.indistinguishable and not diagnosis.undetectable:
        text = "No other hypothesis predicts the trials as well, and no fault is undetectable."
        return Section("separation", "What cannot be distinguished", (text,))
    text = "These hypotheses predict the trials as well as the best one, or nearly so."
    listed = Table(
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


def _trials(subject: Subject, apart: Sequence[Hypothesis]) -> tuple[BarChart | Attachment, ...]:
    """Returns the disagreement of the hypotheses by trial, and a controller evolved for it."""
    drivers: dict[str, CommandSource] = {
        subject.names[trial.path]: trial.plan.controller for trial in subject.damaged
    }
    steps = min(trial.behaviour.steps for trial in subject.damaged)
    separating = _separating(subject, steps)
    if separating is not None:
        drivers["a separating trial"] = separating
    found = _disagreement(subject, apart, list(drivers.values()), steps)
    chart = BarChart(
        title="Disagreement of these hypotheses by trial",
        x_label=f"disagreement in the first {min(steps, EARLY_STEPS)} steps, from 0 to 1",
        names=("disagreement",),
        groups=tuple(
            Group(name, (float(value),)) for name, value in zip(drivers, found, strict=True)
        ),
    )
    if separating is None:
        return (chart,)
    data = base64.b64encode(controller_bytes(separating)).decode("ascii")
    title = f"the controller of a separating trial, for selfmodel trial --controller {FILE}"
    return chart, Attachment(title, FILE, data)


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
