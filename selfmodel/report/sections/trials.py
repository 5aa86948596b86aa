"""Section of the trials: displacement, predicted against observed."""

import math
from collections.abc import Sequence

from selfmodel.report.charts import BarChart, Cell, Group, Table
from selfmodel.report.document import Section
from selfmodel.report.rollouts import TrialRollouts
from selfmodel.report.run_result import TrialResult
from selfmodel.report.subject import Subject

NAMES = ("observed", "best hypothesis or self-model", "runner-up")

TEXT = (
    "A prediction is a simulation of the whole trial by the self-model, with the same controller, "
    "from its initial pose. Trials before the failure are predicted without a fault, all others "
    "under the hypotheses of the last diagnosis."
)


def trials_section(subject: Subject, rolled: Sequence[TrialRollouts]) -> Section:
    """Returns the section of the trials.

    Args:
        subject: The subject.
        rolled: Rollouts of every trial.
    """
    items: list[BarChart | Table] = []
    if not subject.robot.has_fixed_base:
        items.append(
            BarChart(
                title="Forward displacement of each trial, observed and predicted",
                x_label="forward displacement, m",
                names=NAMES,
                groups=tuple(Group(one.name, _displacements(one)) for one in rolled),
            )
        )
    items.append(_table(subject, rolled))
    return Section("trials", "Trials", (TEXT,), tuple(items))


def _displacements(one: TrialRollouts) -> tuple[float, ...]:
    predicted = [rollout.displacement for rollout in one.rollouts]
    predicted += [math.nan] * (len(NAMES) - 1 - len(predicted))
    return (one.trial.displacement, *predicted)


def _table(subject: Subject, rolled: Sequence[TrialRollouts]) -> Table:
    columns = ["trial", "stage", "steps", "observed displacement, m"]
    columns += ["predicted displacement, m", "predicted under"]
    if subject.result is not None:
        score = subject.result.score
        columns += [f"{score.name}, {score.unit}".removesuffix(", ")]
        columns += ["predicted before the trial", "hypothesis at the time", "fell at step"]
    rows = []
    for one in rolled:
        first = one.rollouts[0]
        row: list[Cell] = [one.name, one.trial.plan.stage, one.trial.behaviour.steps]
        row += [one.trial.displacement, first.displacement, str(first.hypothesis)]
        if subject.result is not None:
            row += _scores(subject.result.trials.get(one.name))
        rows.append(tuple(row))
    return Table("Trials", tuple(columns), tuple(rows))


def _scores(found: TrialResult | None) -> list[Cell]:
    if found is None:
        return [None] * 4
    return [found.score, found.predicted, found.hypothesis, found.fell_at_step]
