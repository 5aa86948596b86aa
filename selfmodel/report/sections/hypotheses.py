"""Section of the hypotheses: the loss of each, and how it went from diagnosis to diagnosis."""

import math

from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.report.charts import BarChart, Group, LineChart, Series, Table
from selfmodel.report.document import Section
from selfmodel.report.subject import Subject

MAX_LINES = 4
"""Hypotheses in the chart over diagnoses."""


def hypotheses_section(subject: Subject) -> Section:
    """Returns the section of the hypotheses."""
    diagnosis = subject.diagnosis
    ranked = [(one.hypothesis, one.distance) for one in diagnosis.ranked]
    known = {one for one, _ in ranked}
    if not any(one == Hypothesis() for one in known):
        ranked.append((Hypothesis(), diagnosis.intact_distance))
    chart = BarChart(
        title="Loss of each hypothesis",
        x_label=f"distance by {subject.comparator.name}, summed over the trials",
        names=("distance",),
        groups=tuple(Group(str(one), (distance,)) for one, distance in ranked),
    )
    table = Table(
        "Hypotheses",
        ("rank", "hypothesis", "distance", "against the best"),
        tuple(
            (rank, str(one), distance, _standing(diagnosis, one))
            for rank, (one, distance) in enumerate(ranked, start=1)
        ),
    )
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


def _over_time(subject: Subject) -> LineChart:
    """Returns the distance per trial of the hypotheses of the last diagnosis, by diagnosis."""
    chosen = [candidate.hypothesis for candidate in subject.diagnosis.ranked[:MAX_LINES]]
    counts = tuple(float(diagnosis.trials) for diagnosis in subject.diagnoses)
    lines = [("intact", [one.intact_distance / one.trials for one in subject.diagnoses])]
    for hypothesis in chosen:
        distances = [
            next((c.distance for c in one.ranked if c.hypothesis == hypothesis), math.nan)
            / one.trials
            for one in subject.diagnoses
        ]
        lines.append((str(hypothesis), distances))
    return LineChart(
        title="Distance per trial after each diagnosis",
        x_label="trials explained",
        y_label="distance per trial",
        series=tuple(Series(name, counts, tuple(values)) for name, values in dict(lines).items()),
    )
