import base64
import dataclasses

import pytest

from selfmodel.faults.notation import parse
from selfmodel.logs.controllers import parse_controller
from selfmodel.report.charts import Attachment, BarChart, Table
from selfmodel.report.sections.separation import separation_section
from selfmodel.report.subject import Subject


@pytest.fixture(scope="module")
def ambiguous(subject: Subject) -> Subject:
    other = parse("jam:back_left_knee=0.5", subject.robot.anatomy)
    diagnosis = dataclasses.replace(
        subject.diagnosis, verdict="ambiguous", indistinguishable=(other,), undetectable=()
    )
    return dataclasses.replace(subject, diagnoses=(diagnosis,))


def test_without_alternatives_the_section_says_so(subject: Subject):
    diagnosis = dataclasses.replace(subject.diagnosis, indistinguishable=(), undetectable=())

    section = separation_section(dataclasses.replace(subject, diagnoses=(diagnosis,)))

    assert section.items == ()
    assert section.text[0].startswith("No other hypothesis predicts the trials as well")


def test_hypotheses_that_cannot_be_told_apart_are_listed_with_the_reason(ambiguous: Subject):
    table = separation_section(ambiguous).items[0]

    assert isinstance(table, Table)
    assert table.rows == (("jam:back_left_knee=0.5", "predicts the trials as well"),)


def test_the_evolved_trial_separates_them_better_than_each_trial_so_far(ambiguous: Subject):
    chart = separation_section(ambiguous).items[1]

    assert isinstance(chart, BarChart)
    *tried, separating = chart.groups
    assert [group.label for group in tried] == ["01-after", "02-recovery"]
    assert separating.label == "a separating trial"
    assert separating.values[0] > max(group.values[0] for group in tried)
    assert 0 <= separating.values[0] <= 1


def test_the_controller_of_the_separating_trial_can_be_saved(ambiguous: Subject):
    attachment = separation_section(ambiguous).items[2]

    assert isinstance(attachment, Attachment)
    controller = parse_controller(base64.b64decode(attachment.data), attachment.name)
    assert controller.design == ambiguous.damaged[0].plan.controller.design
    assert controller not in [trial.plan.controller for trial in ambiguous.damaged]
