"""Tests of the sentences of a diagnosis: verdict, change, numbers, limits and direct evidence."""

from typing import Any

import pytest

from selfmodel.diagnosis.diagnosis import Candidate, Diagnosis
from selfmodel.diagnosis.sentences import (
    confidence_sentence,
    detectable_sentences,
    evidence_sentences,
    fit_sentence,
    right_or_wrong,
)
from selfmodel.diagnosis.serialization import confidence_to_dict, ranking_to_list
from selfmodel.diagnosis.verdicts.change_point import Change
from selfmodel.diagnosis.verdicts.detectable import DetectableSeverity
from selfmodel.diagnosis.verdicts.fit import Fit
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.tasks import ROBOTS

JAM = parse("jam:front_left_knee", ROBOTS["quadruped"].robot().anatomy)
CHANGE = Change("02-recovery", 1, 4.92, 4.8, 5.04, INTACT, JAM)


def values_of(**fields: Any) -> dict[str, Any]:  # noqa: ANN401  # fields of a record
    best = fields.pop("best", JAM)
    common = {"verdict": "explained", "test": "by hand", "indistinguishable": ()}
    whole = Diagnosis(
        ranked=(Candidate(best, 0.5),), trials=1, intact_distance=2.0, **{**common, **fields}
    )
    return {**confidence_to_dict(whole), "diagnosis": ranking_to_list(whole.ranked)}


def test_an_intact_robot_has_a_sentence_of_its_own():
    sentence = confidence_sentence(values_of(best=INTACT, verdict="intact"))

    assert sentence.startswith("Intact: ")
    assert "Changed" not in sentence


def test_a_change_follows_the_verdict_with_its_interval_and_the_time_before():
    sentence = confidence_sentence(values_of(change=CHANGE))

    assert sentence == (
        "Explained: jam:front_left_knee predicts the trials, and no other hypothesis does as well. "
        "Changed at about t = 4.9 s (4.8 to 5.0) of 02-recovery; before: intact."
    )


def test_a_change_is_named_before_undetectable_faults():
    more = parse("jam:front_left_knee+jam:back_left_knee", ROBOTS["quadruped"].robot().anatomy)
    sentence = confidence_sentence(values_of(change=CHANGE, undetectable=(more,)))

    assert sentence.endswith("before: intact. Undetectable in these trials: jam:back_left_knee.")


@pytest.mark.parametrize(
    ("fit", "sentence"),
    [
        (None, ""),
        (Fit(float("inf"), 1.0, 0.1, 0.0, 5.0, has_faults=True), ""),
        (
            Fit(0.1234, 0.5, None, None, 5.0, has_faults=True),
            "Mean loss 0.123, of intact 0.5; no trial of the healthy robot to compare with.",
        ),
        (
            Fit(0.1234, float("inf"), 0.1, 2.5, 5.0, has_faults=True),
            (
                "Mean loss 0.123, of intact infinite, on healthy trials 0.1: an excess of 2.5 "
                "standard errors, unexplained above 5 and 2.5 times that loss, or above 3 "
                "times that loss."
            ),
        ),
        (
            Fit(0.1234, 0.5, 0.0, float("inf"), 5.0, has_faults=True),
            (
                "Mean loss 0.123, of intact 0.5, on healthy trials 0: an excess of infinitely many "
                "standard errors, unexplained above 5 and 2.5 times that loss, or above 3 "
                "times that loss."
            ),
        ),
        (
            Fit(0.1234, 0.5, float("inf"), 0.0, 5.0, has_faults=True),
            (
                "Mean loss 0.123, of intact 0.5, on healthy trials infinite: an excess of 0 "
                "standard errors, unexplained above 5 and 2.5 times that loss, or above 3 "
                "times that loss."
            ),
        ),
        (
            Fit(0.15, 0.15, 0.125, 1.0, 5.0, has_faults=False),
            (
                "Mean loss 0.15, of intact 0.15, on healthy trials 0.125: an excess of 1 "
                "standard errors, unexplained above 5, or above 3 times that loss."
            ),
        ),
    ],
)
def test_the_numbers_behind_a_verdict_are_a_sentence(fit: Fit | None, sentence: str):
    assert fit_sentence(values_of(fit=fit)) == sentence


def test_a_joint_that_moves_otherwise_is_named_though_the_loss_is_explained():
    fit = Fit(0.1, 0.1, 0.1, 0.5, 3.5, has_faults=False, joints={"knee": 4.25, "hip": 4.0})
    sentence = confidence_sentence(values_of(best=INTACT, fit=fit, verdict="unexplained"))

    assert "not all joints. Joints whose motion is predicted worse" in sentence
    assert "knee (4.2), hip (4.0)" in sentence
    assert "significantly worse than the self-model" not in sentence


@pytest.mark.parametrize(
    ("best", "truth", "is_correct", "judgement"),
    [
        ("friction=0.4", "friction=0.4", True, "right"),
        ("intact", "neuron:0", True, "right"),
        ("friction=0.3895", "friction=0.4", False, "right except for severity"),
        ("jam:a+wind=9", "wind=12+jam:a=0.3", False, "right except for severity"),
        ("friction=0.4", "slope=0.4", False, "wrong"),
        ("friction=0.4+motor:a=0.9", "friction=0.4", False, "wrong"),
        ("intact", "friction=0.4", False, "wrong"),
        ("encoder-offset:a=0.1", "encoder-offset:a=slip0.1", False, "wrong"),
        ("sensor:a1=gain0.2", "sensor:a1=gain0.3", False, "right except for severity"),
        ("motor:leg1=0.2", "motor:leg2=0.2", False, "wrong"),
    ],
)
def test_the_right_faults_at_another_severity_are_not_wrong(
    best: str,
    truth: str,
    is_correct: bool,  # noqa: FBT001  # a parameter of cases
    judgement: str,
):
    found = {"correct": is_correct, "truth": truth, "diagnosis": [{"hypothesis": best}]}

    assert right_or_wrong(found) == judgement


def test_the_limits_of_a_kind_are_one_clause_and_equal_limits_are_named_together():
    rows = (
        DetectableSeverity("motor", "a", below=0.7, above=None),
        DetectableSeverity("motor", "b", below=0.5, above=None),
        DetectableSeverity("motor", "c", below=0.7, above=None),
        DetectableSeverity("motor", "d", below=None, above=None),
        DetectableSeverity("friction", "", below=0.5, above=1.25),
    )
    sentences = detectable_sentences(values_of(best=INTACT, verdict="intact", detectable=rows))

    assert sentences == [
        (
            "These trials would have shown: motor up to 0.7 (a, c), up to 0.5 (b), no severity "
            "(d); friction up to 0.5 or from 1.25. Smaller changes are below the limit."
        ),
    ]


def test_without_limits_there_is_no_sentence():
    assert detectable_sentences(values_of()) == []


def test_direct_evidence_is_a_sentence_for_each_trial_with_a_fact():
    values = {
        "evidence": [
            {
                "trial": "00",
                "commands_without_effect": ["front_left_knee", "back_left_knee"],
                "constant_sensors": [{"sensor": "front_left_touch", "reading": 0.0}],
            },
            {"trial": "01", "commands_without_effect": [], "constant_sensors": []},
            {
                "trial": "02",
                "commands_without_effect": [],
                "constant_sensors": [
                    {"sensor": "a", "reading": 1.0},
                    {"sensor": "b", "reading": 0.25},
                ],
            },
        ]
    }

    assert evidence_sentences(values) == [
        (
            "In 00, commands without effect: front_left_knee, back_left_knee; constant readings: "
            "front_left_touch (0)."
        ),
        "In 02, constant readings: a (1), b (0.25).",
    ]
