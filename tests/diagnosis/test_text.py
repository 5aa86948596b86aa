"""Tests of the sentences of a diagnosis: verdict, change, numbers, limits and direct evidence."""

import dataclasses
from typing import Any

import pytest

from selfmodel.diagnosis.diagnosis import (
    Candidate,
    Change,
    DetectableSeverity,
    Diagnosis,
    Doubt,
    Fit,
    UnsearchedFault,
)
from selfmodel.diagnosis.direct_evidence import ConstantSensor, DirectEvidence
from selfmodel.diagnosis.text import (
    detectable_sentences,
    evidence_sentences,
    fit_sentence,
    right_or_wrong,
    summary,
    verdict_sentences,
)
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.tasks import ROBOTS

ANATOMY = ROBOTS["quadruped"].robot().anatomy
JAM, OTHER = (parse(f"jam:{leg}_knee", ANATOMY) for leg in ("front_left", "back_left"))
BOTH = parse(f"{JAM}+{OTHER}", ANATOMY)
DOUBT = Doubt("WHY", "DO THIS")
CHANGE = Change("02-recovery", 1, 4.92, 4.8, 5.04, INTACT, JAM)


def diagnosis(**fields: Any) -> Diagnosis:  # noqa: ANN401  # fields of a record
    best = fields.pop("best", JAM)
    common = {"verdict": "explained", "test": "by hand", "indistinguishable": ()}
    return Diagnosis(
        ranked=(Candidate(best, 0.5),), trials=1, intact_distance=2.0, **{**common, **fields}
    )


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        (
            {"best": INTACT, "verdict": "intact"},
            "Intact: the healthy robot predicts the trials, and no other hypothesis does so.",
        ),
        (
            {"verdict": "ambiguous", "indistinguishable": (OTHER,)},
            (
                "Ambiguous: the trials do not distinguish jam:front_left_knee from "
                "jam:back_left_knee (by hand)."
            ),
        ),
        (
            {"verdict": "unexplained"},  # of 0.1, without numbers
            (
                "Unexplained: even jam:front_left_knee predicts the trials significantly worse "
                "than the self-model predicts the healthy robot; there is another fault, or one "
                "of a kind that was not searched (--kinds)."
            ),
        ),
        (
            {"verdict": "not judged", "doubt": DOUBT},
            "Not judged: WHY, so that a fault and an error of the self-model cannot be told apart.",
        ),
    ],
)
def test_each_verdict_has_a_sentence_of_its_own(fields: dict[str, Any], sentence: str):
    assert verdict_sentences(diagnosis(**fields)) == sentence


def test_the_change_and_the_undetectable_faults_follow_the_verdict():
    alone = verdict_sentences(diagnosis(change=CHANGE))
    both = verdict_sentences(diagnosis(change=CHANGE, undetectable=(BOTH,)))

    changed = "Changed at about t = 4.9 s (4.8 to 5.0) of 02-recovery; before: intact."
    explained = "Explained: jam:front_left_knee predicts the trials"
    assert alone == f"{explained}, and no other hypothesis does as well. {changed}"
    assert both == f"{explained}. {changed} Undetectable in these trials: jam:back_left_knee."


@pytest.mark.parametrize(
    ("fit", "sentence"),
    [
        (None, ""),
        (Fit(float("inf"), 1.0, 0.1, 0.0, 5.0, has_faults=True), ""),
        (
            Fit(0.1234, 0.5, None, None, 5.0, has_faults=True),
            "Mean loss 0.123, intact 0.5; no trial of the healthy robot to compare with.",
        ),
        (
            Fit(2e-30, float("inf"), 0.1, 0.0, 6.0, has_faults=False),
            (
                "Residual 0.0 \u03c3 above the expected loss (limit 6 \u03c3, or 3 times that "
                "loss); mean loss 0, intact infinite, expected 0.1."
            ),
        ),
        (
            Fit(0.1234, 0.5, 0.0, float("inf"), 3.5, has_faults=True),
            (
                "Residual infinitely many \u03c3 above the expected loss (limit 3.5 \u03c3, or 3 "
                "times that loss); mean loss 0.123, intact 0.5, expected 0."
            ),
        ),
    ],
)
def test_the_numbers_behind_a_verdict_are_a_sentence(fit: Fit | None, sentence: str):
    assert fit_sentence(diagnosis(fit=fit)) == sentence


def test_a_joint_that_moves_otherwise_is_named_though_the_loss_is_explained():
    fit = Fit(0.1, 0.1, 0.1, 0.5, 3.5, has_faults=False, joints={"knee": 4.25, "hip": 4.0})
    sentence = verdict_sentences(diagnosis(best=INTACT, fit=fit, verdict="unexplained"))

    assert "not all joints. Joints that the healthy trials predict better: knee (4.2" in sentence
    assert "hip (4.0" in sentence
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
    assert right_or_wrong(best, truth, correct=is_correct) == judgement


def test_the_limits_of_a_kind_are_one_clause_and_equal_limits_are_named_together():
    rows = (
        DetectableSeverity("motor", "a", below=0.7, above=None),
        DetectableSeverity("motor", "b", below=0.5, above=None),
        DetectableSeverity("motor", "c", below=0.7, above=None),
        DetectableSeverity("motor", "d", below=None, above=None),
        DetectableSeverity("friction", "", below=0.5, above=1.25),
    )
    sentences = detectable_sentences(diagnosis(best=INTACT, verdict="intact", detectable=rows))

    assert sentences == [
        (
            "These trials would have shown: motor up to 0.7 (a, c), up to 0.5 (b), no severity "
            "(d); friction up to 0.5 or from 1.25. Smaller changes are below the limit."
        )
    ]


def test_direct_evidence_is_a_sentence_for_each_trial_with_a_fact():
    knees = ("front_left_knee", "back_left_knee")
    touch, ones = ConstantSensor("front_left_touch", 0.0), ConstantSensor("a", 1.0)
    evidence = (
        DirectEvidence("00", (), (touch,), knees),
        DirectEvidence("01", (), (), ()),
        DirectEvidence("02", (), (ones, ConstantSensor("b", 0.25)), ()),
    )

    assert evidence_sentences(evidence) == [
        (
            "In 00, commands without effect: front_left_knee, back_left_knee; constant readings: "
            "front_left_touch (0)."
        ),
        "In 02, constant readings: a (1), b (0.25).",
    ]


MISSED = UnsearchedFault(parse("grip:front_left_knee=0.2", ANATOMY), "grip")
JOINT = Fit(0.1, 0.1, 0.1, 0.0, 3.5, has_faults=False, joints={"knee": 7.0})
HEALTHY = Fit(0.1, 0.5, 0.1, 0.0, 3.5, has_faults=True)
UNEXPLAINED = "Probably something is wrong that is not among the faults that were tried"
NOTHING = "Nothing is wrong that is large enough to show in these logs"
MEND = "mend it, or evolve a controller for the robot as it is (selfmodel.evolve)"
AGAIN = (
    "record this robot again, with the same movements for twice as long, and diagnose the new log."
)
ALL_KINDS = (
    "repeat the diagnosis with all kinds of faults (--kinds all). If this was done, look over the "
    "whole robot: no kind of fault that can be simulated explains its logs."
)
HEALTHY_LOG = "repeat the diagnosis with a log of the healthy robot (--healthy FILE)."


def test_a_fault_before_a_change_is_not_forgotten():
    earlier = dataclasses.replace(CHANGE, before=OTHER)
    ended, action = summary(diagnosis(best=INTACT, verdict="intact", change=earlier))

    assert ended.startswith("Until about 4.9 s into the log '02-recovery': the joint back_left_kn")
    assert f"After that: n{NOTHING[1:]} (" in ended
    assert "check the earlier fault" in action
    _, action = summary(diagnosis(verdict="ambiguous", indistinguishable=(BOTH,), change=earlier))
    assert "check whether the joint front_left_knee is stuck, then (2)" in action
    unknown, _ = summary(diagnosis(verdict="not judged", change=CHANGE))
    assert "'02-recovery': nothing is wrong. After that: it is not known" in unknown


@pytest.mark.parametrize(
    ("fields", "what", "action"),
    [
        (
            {"best": INTACT, "verdict": "intact", "probability": {"intact": 0.954}},
            f"{NOTHING} (95 % sure: about 5 of 100 such answers are wrong).",
            f"nothing. To find smaller faults, {AGAIN}",
        ),
        (
            {"best": INTACT, "verdict": "intact", "probability": {"intact": 0.534}},
            f"{NOTHING} (53 % sure: about 47 of 100 such answers are wrong).",
            AGAIN,
        ),
        (
            {"change": CHANGE, "probability": {str(JAM): 0.93, str(OTHER): 0.001}},
            (
                "The joint front_left_knee is stuck (93 % sure: about 7 of 100 such answers are "
                "wrong). This began about 4.9 s into the log '02-recovery'."
            ),
            f"check whether this is so. If it is, {MEND}. If not, {AGAIN}",
        ),
        (
            {"fit": None},
            (
                "The joint front_left_knee is stuck (a log of the healthy robot is needed to say "
                "how sure this is)."
            ),
            f"check whether this is so. If it is, {MEND}. If not, {HEALTHY_LOG}",
        ),
        (
            {"best": parse("slope=-0.081+wind=-22.27", ANATOMY)},
            (
                "Nothing is wrong with the robot itself: the robot starts facing downhill, on a "
                "slope of 4.6 degrees (0.081 rad), and a wind of 22 m/s blows from the front, as "
                "seen at the start (it is not known how sure this is)."
            ),
            f"check each. If all are so, nothing is to be done. If one is not, {AGAIN}",
        ),
        (
            {"best": parse("slope=-0.1+jam:front_left_knee", ANATOMY)},
            (
                "The joint front_left_knee is stuck, and the robot starts facing downhill, on a "
                "slope of 5.7 degrees (0.1 rad) (it is not known how sure this is)."
            ),
            f"check each. If all are so, {MEND}. If one is not, {AGAIN}",
        ),
        (
            {
                "verdict": "ambiguous",
                "indistinguishable": (INTACT, OTHER),
                "probability": {str(JAM): 0.6, str(OTHER): 0.346, "intact": 0.004},
            },
            (
                "One of these is true: (1) the joint front_left_knee is stuck (60 % likely); (2) "
                "the joint back_left_knee is stuck (35 % likely); (3) nothing is wrong (< 1 % "
                "likely); (4) something else (5 % likely)."
            ),
            f"check (1), then (2). If none of these is so, {AGAIN}",
        ),
        (
            {"verdict": "ambiguous", "indistinguishable": (OTHER,), "fit": None},
            (
                "One of these is true: (1) the joint front_left_knee is stuck; (2) the joint "
                "back_left_knee is stuck."
            ),
            f"check (1), then (2). If none of these is so, {HEALTHY_LOG}",
        ),
        (
            {"verdict": "ambiguous", "indistinguishable": (INTACT,)},
            ("One of these is true: (1) the joint front_left_knee is stuck; (2) nothing is wrong."),
            f"check (1). If it is not so, {AGAIN}",
        ),
        (
            {
                "best": BOTH,
                "verdict": "ambiguous",
                "indistinguishable": (JAM,),
                "probability": {str(BOTH): 0.6, f"{JAM}=0.3": 0.1, str(JAM): 0.2, str(OTHER): 0.05},
            },
            (
                "The joint front_left_knee is stuck (90 % sure: about 10 of 100 such answers are "
                "wrong). In addition, one of these is true: (1) the joint back_left_knee is stuck; "
                "(2) nothing else is wrong."
            ),
            (
                "check whether the joint front_left_knee is stuck, then (1). If none of these is "
                f"so, {AGAIN}"
            ),
        ),
        (
            {"verdict": "unexplained", "unsearched": MISSED, "probability": {str(JAM): 0.04}},
            f"{UNEXPLAINED} (96 % sure: about 4 of 100 such answers are wrong).",
            (
                "a kind of fault that was not asked for fits these logs best. Check whether the "
                "foot below the joint front_left_knee has 20 % of its grip left. Then repeat "
                "the diagnosis with this kind of fault too (add grip to --kinds; default,grip if "
                "none were given)."
            ),
        ),
        (
            {"verdict": "unexplained", "fit": JOINT, "best": INTACT},
            f"{UNEXPLAINED} (it is not known how sure this is).",
            f"check the joint knee, where log and model differ most. Then {ALL_KINDS}",
        ),
        (
            {"verdict": "unexplained", "probability": {str(JAM): 0.3, str(OTHER): 0.1}},
            (
                f"{UNEXPLAINED} (60 % sure: about 40 of 100 such answers are wrong). Or the joint "
                "front_left_knee is stuck (30 % likely)."
            ),
            f"check whether the joint front_left_knee is stuck. If not, {ALL_KINDS}",
        ),
        (
            {"verdict": "unexplained", "probability": {str(JAM): 0.04}},
            f"{UNEXPLAINED} (96 % sure: about 4 of 100 such answers are wrong).",
            ALL_KINDS,
        ),
        (
            {"verdict": "unexplained", "best": INTACT, "probability": {"intact": 0.36}},
            (
                f"{UNEXPLAINED} (64 % sure: about 36 of 100 such answers are wrong). Or nothing is "
                "wrong (36 % likely)."
            ),
            ALL_KINDS,
        ),
        (
            {"verdict": "unexplained", "reason": "no simulation works"},
            "No diagnosis: every simulation with this robot model becomes unstable.",
            "check the robot model (--robot), and the logs' units (rad, m, s) and odometry.",
        ),
        (
            {"verdict": "not judged", "doubt": DOUBT},
            (
                "It is not known whether the robot has a fault. An error in the simulation model "
                "could explain these logs too."
            ),
            "DO THIS.",
        ),
    ],
)
def test_the_summary_says_what_is_wrong_how_sure_since_when_and_what_to_do(
    fields: dict[str, Any], what: str, action: str
):
    assert summary(diagnosis(**{"fit": HEALTHY, **fields})) == (what, f"What to do: {action}")


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ("encoder-offset:front_left_knee=slip0.2", "reads 0.2 rad too high"),
        ("encoder-offset:front_left_knee=-0.2", "is 0.2 rad too low"),
        ("sensor:front_left_touch=bias-0.2", "reads 20 % of its range too low"),
        ("payload:front=0.2", "a load of 20 % of its mass at the front"),
        ("payload=0.2", "a load of 20 % of its mass"),
        ("damping:front_left_knee=100.0", "is too high, 100 times that of its model"),
        ("damping:front_left_knee=0.5", "is too low, 0.5 times that of its model"),
        ("wind=-22.27", "a wind of 22 m/s blows from the front, as seen at the start"),
        ("wind=12", "from the rear, as seen at the start"),
        ("crosswind=-8", "from the left, as seen at the start"),
        ("slope=-0.081", "facing downhill, on a slope of 4.6 degrees (0.081 rad)"),
    ],
)
def test_the_words_of_a_fault_say_its_direction_its_place_and_its_amount_without_a_power(
    fault: str, said: str
):
    assert parse(fault, ANATOMY).words.endswith(said)
