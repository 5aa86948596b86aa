"""The sentences and sections of a report: what happened, with the numbers of the result."""

import dataclasses
import json
from pathlib import Path

import msgspec
import numpy as np

from selfmodel.diagnosis.text import summary
from selfmodel.faults.notation import parse
from selfmodel.report.charts import GaitDiagram
from selfmodel.report.content import (
    details,
    gait_section,
    headline,
    hypotheses_section,
    report_of,
    trials_section,
)
from selfmodel.report.scene import Shot
from selfmodel.report.subject import Subject


def with_verdict(subject: Subject, **changes: object) -> Subject:
    diagnosis = dataclasses.replace(subject.diagnosis, **changes)
    return dataclasses.replace(subject, diagnoses=(diagnosis,), result=None)


def test_a_report_has_every_section_and_the_numbers_of_the_result(run: Path, subject: Subject):
    result = json.loads((run / "result.json").read_text())

    report = report_of(subject)

    assert [section.key for section in report.sections] == [
        *("trials", "hypotheses", "residual", "separation", "searches", "calibration", "gait")
    ]
    assert report.headline.startswith(f"The quadruped moved {result['score']['before']:.3f} m")
    assert f"moved {result['score']['recovered']:.3f} m at best in 1 trial since" in report.headline
    assert summary(subject.diagnosis)[0] in report.headline
    warnings = {one for one in report.verdict if one.startswith("Warning: ")}
    assert warnings == {f"Warning: {one}." for one in result["warnings"]} != set()
    assert f"True faults: {result['truth']}, at a reality gap of 0.1" in report.verdict[-1]
    trials = report.sections[0].items[1]
    assert [row[6] for row in trials.rows] == [one["score"] for one in result["trials"]]
    ranking = report.sections[1].items[1].rows
    assert ranking[0][1:3] == tuple(result["diagnosis"][0].values())


def test_a_score_other_than_the_displacement_has_its_chart_with_falls_and_its_limit(
    subject: Subject, shots: tuple[Shot, ...]
):
    score = msgspec.structs.replace(subject.result.score, name="return", unit="", most=99)
    trials = [msgspec.structs.replace(one, fell_at_step=7) for one in subject.result.trials]
    changes = {"score": score, "trials": tuple(trials), "fell": True}
    result = msgspec.structs.replace(subject.result, **changes)
    scored = dataclasses.replace(subject, result=result)

    chart, displacement, _ = trials_section(scored, shots).items
    values = np.array([one.values for one in chart.groups])
    expected = [(one.score, one.predicted_score) for one in trials]
    np.testing.assert_equal(values, np.array(expected, dtype=float))
    assert chart.x_label == "return (of 99)"
    assert (chart.groups[0].label, chart.groups[0].notes) == ("00-before", ("fell at step 7",))
    assert displacement.x_label == "forward displacement, m"
    said = headline(scored)
    assert f"scored {score.before:.3f} of 99 (return) before the failure" in said
    assert said.endswith("at best in 1 trial since, and fell, which is no recovery.")


def test_the_chart_of_displacements_marks_the_trials_that_fell(
    subject: Subject, shots: tuple[Shot, ...]
):
    first, second, *others = shots
    logged = first.trial.trajectory
    turned = dict(logged.signals, base_orientation=logged["base_orientation"].copy())
    turned["base_orientation"][30:] = [0.0, 1.0, 0.0, 0.0]
    trajectory = dataclasses.replace(logged, signals=turned)
    fell = dataclasses.replace(first, trial=dataclasses.replace(first.trial, trajectory=trajectory))
    (chart,) = (
        one
        for one in trials_section(subject, (fell, second, *others)).items
        if one.title.startswith("Forward displacement")
    )
    assert [one.notes for one in chart.groups[:2]] == [("fell at step 30",), ("",)]


def test_logs_have_their_number_and_the_summary_and_no_truth(subject: Subject):
    of_logs = with_verdict(subject, verdict="unexplained")

    assert headline(of_logs) == f"2 trials of the quadruped. {summary(of_logs.diagnosis)[0]}"
    assert not any("True" in one for one in details(of_logs))


def test_an_ambiguous_diagnosis_names_three_hypotheses_and_counts_the_rest(subject: Subject):
    others = tuple(
        parse(f"motor:{joint}=0.9", subject.robot.anatomy)
        for joint in ("back_left_knee", "back_right_knee", "front_left_knee", "front_right_knee")
    )

    found = headline(with_verdict(subject, verdict="ambiguous", indistinguishable=others))

    assert "(3) the motor of the joint back_right_knee has 90 % of its torque left" in found
    assert "(4) something else (" in found
    without = {"indistinguishable": others, "probability": {}}
    found = headline(with_verdict(subject, verdict="ambiguous", **without))
    assert found.endswith("(4) one of 2 others.")


def test_the_spans_of_a_lane_are_the_times_of_contact(subject: Subject, shots: tuple[Shot, ...]):
    section = gait_section(subject, shots)
    assert section is not None
    diagram = section.items[0]
    assert isinstance(diagram, GaitDiagram)
    first = dataclasses.replace(shots[0].rollouts[0], diverged=True)
    alone = gait_section(subject, (dataclasses.replace(shots[0], rollouts=(first,)),))
    assert list(alone.items[0].groups) == ["measured"], "a simulation that diverged has none"
    trajectory = shots[0].trial.trajectory
    for lane in diagram.groups["measured"]:
        column = trajectory.names.sensors.index(lane.label)
        contact = np.zeros(trajectory.steps, dtype=bool)
        for begin, end in lane.spans:
            contact |= (trajectory.time >= begin) & (trajectory.time < end)

        assert np.array_equal(contact[:-1], (trajectory["sensors"][:, column] > 0.5)[:-1])


def test_the_table_of_hypotheses_has_probabilities_of_two_digits(subject: Subject):
    best = str(subject.diagnosis.best)
    found = hypotheses_section(with_verdict(subject, probability={best: 0.1234567}))
    assert found.items[1].rows[0][3] == 0.12
