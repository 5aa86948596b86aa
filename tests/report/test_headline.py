import dataclasses

import pytest

from selfmodel.faults.notation import parse
from selfmodel.report.headline import details, headline
from selfmodel.report.subject import Subject


def with_verdict(subject: Subject, **changes: object) -> Subject:
    diagnosis = dataclasses.replace(subject.diagnosis, **changes)
    return dataclasses.replace(subject, diagnoses=(diagnosis,), result=None)


def test_logs_have_a_sentence_without_scores(subject: Subject):
    found = headline(with_verdict(subject, verdict="explained"))

    best = subject.diagnosis.best
    assert (
        found == f"2 trials of the quadruped: it has the fault {best}, which explains its trials."
    )


@pytest.mark.parametrize(
    ("verdict", "said"),
    [
        ("intact", "it is healthy: no fault is needed"),
        ("unexplained", "no searched hypothesis explains; the nearest is"),
    ],
)
def test_every_verdict_has_its_sentence(subject: Subject, verdict: str, said: str):
    assert said in headline(with_verdict(subject, verdict=verdict))


def test_an_ambiguous_diagnosis_names_three_hypotheses_and_counts_the_rest(subject: Subject):
    others = tuple(
        parse(f"motor:{joint}=0.9", subject.robot.anatomy)
        for joint in ("back_left_knee", "back_right_knee", "front_left_knee", "front_right_knee")
    )

    found = headline(with_verdict(subject, verdict="ambiguous", indistinguishable=others))

    assert "or motor:back_left_knee=0.9 or motor:back_right_knee=0.9 or one of 2 others" in found


def test_the_truth_of_a_run_is_named(subject: Subject):
    assert subject.result is not None
    assert f"True faults: {subject.result.truth}, at a reality gap of 0.1" in details(subject)[-1]
    assert not any("True" in one for one in details(with_verdict(subject)))
