"""The evidence in a report: losses over time, errors by sensor, and what would separate."""

import dataclasses

import numpy as np
import pytest

from selfmodel.comparators import COMPARATORS
from selfmodel.diagnosis.diagnosis import Change
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.logs.controllers import parse_controller
from selfmodel.recording import load_policy
from selfmodel.report.charts import Attachment, BarChart, HeatMap, LineChart, Section, Table
from selfmodel.report.evidence import residual_section, separation_section
from selfmodel.report.subject import Subject


def residual(subject: Subject, **changes: object) -> Section:
    section = residual_section(dataclasses.replace(subject, **changes))
    assert section is not None
    return section


def test_the_losses_are_those_of_the_comparator(subject: Subject):
    by_hypothesis, by_signal, _ = residual(subject).items
    assert isinstance(by_hypothesis, LineChart)
    assert isinstance(by_signal, LineChart)

    (losses,) = subject.losses.losses([subject.diagnosis.best], subject.damaged)

    assert by_hypothesis.series[0].y == tuple(losses)
    assert np.allclose(np.sum([one.y for one in by_signal.series], axis=0), losses)
    assert [one.name.split(":")[0] for one in by_hypothesis.series][0::2] == ["best", "healthy"]
    names = [(mark.label, mark.value) for mark in by_hypothesis.marks]
    assert names == [("01-after", 0.0), ("02-recovery", pytest.approx(0.6))]


def test_a_change_is_marked_with_its_interval_in_its_trial(subject: Subject):
    change = Change("02-recovery", 1, 0.3, 0.2, 0.4, INTACT, subject.diagnosis.best)
    diagnosis = dataclasses.replace(subject.diagnosis, change=change)

    section = residual(subject, diagnoses=(diagnosis,))

    mark = section.items[0].marks[-1]
    assert (mark.value, mark.low, mark.high) == pytest.approx((0.9, 0.8, 1.0))
    said = "changed at about t = 0.3 s (0.2 to 0.4) of 02-recovery; before: intact"
    assert said in section.text[1]


def test_the_heat_map_has_a_row_for_each_sensor_and_encoder(subject: Subject):
    heat = residual(subject).items[-1]
    assert isinstance(heat, HeatMap)

    names = subject.damaged[0].trajectory.names
    encoders = [f"encoder {one}" for one in names.hinges]
    assert [row.label for row in heat.rows] == [*names.sensors, *encoders]
    assert all(len(row.values) == len(heat.begin) == len(heat.end) for row in heat.rows)


def test_a_comparator_of_whole_trials_has_the_errors_by_sensor_alone(subject: Subject):
    section = residual(subject, comparator=COMPARATORS["gait-pattern"])

    assert [type(item) for item in section.items] == [HeatMap]


def test_without_alternatives_the_section_has_a_sentence_alone(subject: Subject):
    diagnosis = dataclasses.replace(subject.diagnosis, indistinguishable=(), undetectable=())

    section = separation_section(dataclasses.replace(subject, diagnoses=(diagnosis,)))

    assert (section.items, len(section.text)) == ((), 1)


def test_a_trial_is_evolved_that_separates_the_alternatives_and_can_be_saved(subject: Subject):
    other = parse("jam:back_left_knee=0.5", subject.robot.anatomy)
    changes = {"verdict": "ambiguous", "indistinguishable": (other,), "undetectable": ()}
    diagnosis = dataclasses.replace(subject.diagnosis, **changes)

    table, chart, attachment = separation_section(
        dataclasses.replace(subject, diagnoses=(diagnosis,))
    ).items

    assert isinstance(table, Table)
    assert table.rows == ((str(other), "predicts the trials as well"),)
    assert isinstance(chart, BarChart)
    *tried, separating = chart.groups
    assert [group.label for group in tried] == ["01-after", "02-recovery"]
    assert 1 >= separating.values[0] > max(group.values[0] for group in tried) >= 0
    assert isinstance(attachment, Attachment)
    controller = parse_controller(attachment.data, attachment.name)
    assert controller.design == subject.damaged[0].plan.controller.design
    assert controller not in [trial.plan.controller for trial in subject.damaged]


def test_no_trial_is_evolved_from_a_policy_which_has_no_weights(subject: Subject):
    terms = {"observation": [{"term": "joint_positions"}]}
    policy = load_policy(terms, subject.robot, lambda seen: -seen)
    damaged = tuple(
        dataclasses.replace(one, plan=dataclasses.replace(one.plan, controller=policy))
        for one in subject.damaged
    )
    other = parse("jam:back_left_knee=0.5", subject.robot.anatomy)
    diagnosis = dataclasses.replace(subject.diagnosis, indistinguishable=(other,))
    changed = dataclasses.replace(subject, damaged=damaged, diagnoses=(diagnosis,))

    assert [type(item) for item in separation_section(changed).items] == [Table, BarChart]
